//! Long native work that Ctrl-C can end. Python hands signals to its main thread only, so work that
//! stays on that thread asks for them now and then, and work on other threads is watched from it.

use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc;
use std::time::{Duration, Instant};

use pyo3::prelude::*;

const POLL: Duration = Duration::from_millis(50);

/// What the work asks to learn whether it should end.
pub type Stop<'a> = &'a (dyn Fn() -> bool + Sync);

/// Run `work` on this thread without the interpreter lock.
///
/// # Errors
/// What a signal handler raised, for example `KeyboardInterrupt`.
pub fn run_here<T: Send>(py: Python<'_>, work: impl FnOnce(Stop<'_>) -> T + Send) -> PyResult<T> {
    let watch = Mutex::new((Instant::now(), None::<PyErr>));
    let result = py.detach(|| {
        work(&|| {
            let Ok(mut state) = watch.lock() else { return true };
            if state.1.is_none() && state.0.elapsed() >= POLL {
                state.0 = Instant::now();
                state.1 = Python::attach(|py| py.check_signals()).err();
            }
            state.1.is_some()
        })
    });
    match watch.into_inner() {
        Ok((_, Some(error))) => Err(error),
        _ => Ok(result),
    }
}

/// Run `work` on another thread and watch for signals on this one.
///
/// # Errors
/// What a signal handler raised, for example `KeyboardInterrupt`.
pub fn run_beside<T: Send>(py: Python<'_>, work: impl FnOnce(Stop<'_>) -> T + Send) -> PyResult<T> {
    let stop = AtomicBool::new(false);
    py.detach(|| {
        std::thread::scope(|scope| {
            let (done, wait) = mpsc::channel();
            let stop = &stop;
            let worker = scope.spawn(move || {
                let result = work(&|| stop.load(Ordering::Relaxed));
                // The receiver lives until the scope ends, so a failed send cannot lose the result.
                let _ = done.send(());
                result
            });
            let mut raised = None;
            while let Err(mpsc::RecvTimeoutError::Timeout) = wait.recv_timeout(POLL) {
                if raised.is_none()
                    && let Err(error) = Python::attach(|py| py.check_signals())
                {
                    raised = Some(error);
                    stop.store(true, Ordering::Relaxed);
                }
            }
            let result = match worker.join() {
                Ok(result) => result,
                Err(payload) => std::panic::resume_unwind(payload),
            };
            raised.map_or(Ok(result), Err)
        })
    })
}
