//! Long native work that Ctrl-C can end: the work runs on another thread, this one asks Python for
//! signals and passes a stop on.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc;
use std::time::Duration;

use pyo3::prelude::*;

const POLL: Duration = Duration::from_millis(50);

/// Run `work` without the interpreter lock; it should end soon after the flag is set.
///
/// # Errors
/// What a signal handler raised, for example `KeyboardInterrupt`.
pub fn run<T: Send>(py: Python<'_>, work: impl FnOnce(&AtomicBool) -> T + Send) -> PyResult<T> {
    let stop = AtomicBool::new(false);
    py.detach(|| {
        std::thread::scope(|scope| {
            let (done, wait) = mpsc::channel();
            let stop = &stop;
            let worker = scope.spawn(move || {
                let result = work(stop);
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
