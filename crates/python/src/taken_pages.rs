//! Pages of a mapped file that another process takes away: zeros and a mark, not the end of this one.
//!
//! Who shortens a file takes the pages beyond its new end from every mapping of it, and reading them
//! raises SIGBUS. The handler here puts zeros in their place, for mappings that are watched, so that a
//! reader comes to its end and is told by `is_cut` that what it read is worthless.

use std::sync::Once;
use std::sync::atomic::{AtomicBool, AtomicPtr, AtomicUsize, Ordering::SeqCst};

/// Mappings that can be watched at a time: as many as files may be open where nobody asks for more.
/// Logs beyond them are read whole, into memory of this process.
const PLACES: usize = 1024;
static PLACES_WATCHED: [Place; PLACES] = [const { Place::free() }; PLACES];
static PAGE: AtomicUsize = AtomicUsize::new(4096);
static EARLIER: AtomicPtr<libc::sigaction> = AtomicPtr::new(std::ptr::null_mut());
static INSTALLED: Once = Once::new();

/// Where a mapping lies; what the handler reads is atomic, since it may run at any instruction.
struct Place {
    is_taken: AtomicBool,
    start: AtomicUsize,
    length: AtomicUsize,
    is_cut: AtomicBool,
}

impl Place {
    const fn free() -> Self {
        Self {
            is_taken: AtomicBool::new(false),
            start: AtomicUsize::new(0),
            length: AtomicUsize::new(0),
            is_cut: AtomicBool::new(false),
        }
    }
}

/// A watched mapping; drop it before the mapping.
pub struct Watch(&'static Place);

impl Watch {
    /// Watch a mapping; None where too many are watched already.
    pub fn over(bytes: &[u8]) -> Option<Self> {
        INSTALLED.call_once(install);
        let free = |place: &&Place| !place.is_taken.swap(true, SeqCst);
        let place = PLACES_WATCHED.iter().find(free)?;
        place.is_cut.store(false, SeqCst);
        place.start.store(bytes.as_ptr() as usize, SeqCst);
        place.length.store(bytes.len(), SeqCst);
        Some(Self(place))
    }

    /// Whether zeros were read in place of pages that were gone.
    pub fn is_cut(&self) -> bool {
        self.0.is_cut.load(SeqCst)
    }
}

impl Drop for Watch {
    fn drop(&mut self) {
        self.0.length.store(0, SeqCst);
        self.0.is_taken.store(false, SeqCst);
    }
}

fn install() {
    // SAFETY: both structures are written whole before they are read, and the one that holds the
    // earlier action is never freed.
    unsafe {
        PAGE.store(usize::try_from(libc::sysconf(libc::_SC_PAGESIZE)).unwrap_or(4096), SeqCst);
        let mut ours: libc::sigaction = std::mem::zeroed();
        ours.sa_sigaction = on_fault as *const () as usize;
        ours.sa_flags = libc::SA_SIGINFO | libc::SA_ONSTACK;
        let earlier = Box::into_raw(Box::new(std::mem::zeroed::<libc::sigaction>()));
        libc::sigaction(libc::SIGBUS, std::ptr::null(), earlier);
        EARLIER.store(earlier, SeqCst);
        libc::sigaction(libc::SIGBUS, &raw const ours, std::ptr::null_mut());
    }
}

extern "C" fn on_fault(_: i32, info: *mut libc::siginfo_t, _: *mut libc::c_void) {
    // SAFETY: the system hands over a valid `info`. Only atomics and system calls are used, which a
    // handler may. The pages that are replaced lie inside a mapping of this module's caller, which
    // lives as long as it is watched.
    unsafe {
        let address = (*info).si_addr() as usize;
        let page = PAGE.load(SeqCst);
        for place in &PLACES_WATCHED {
            let (start, length) = (place.start.load(SeqCst), place.length.load(SeqCst));
            if address.wrapping_sub(start) < length {
                let first = address - address % page;
                let rest = (start + length).next_multiple_of(page) - first;
                let kind = libc::MAP_PRIVATE | libc::MAP_ANON | libc::MAP_FIXED;
                let made = libc::mmap(first as *mut _, rest, libc::PROT_READ, kind, -1, 0);
                if made != libc::MAP_FAILED {
                    place.is_cut.store(true, SeqCst);
                    return;
                }
            }
        }
        // Of others: the read is done again under the action that stood before ours.
        libc::sigaction(libc::SIGBUS, EARLIER.load(SeqCst), std::ptr::null_mut());
    }
}
