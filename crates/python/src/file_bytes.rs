//! The bytes of a log file: mapped where the system can and can survive a cut, else read.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use pyo3::prelude::*;

#[cfg(unix)]
use {
    crate::error::from_logs,
    crate::taken_pages::Watch,
    flightid_logs::LogError,
    memmap2::{Mmap, MmapOptions},
};

/// Bytes that stay as they are as long as nobody writes to the file.
pub enum FileBytes {
    /// Pages of the file itself, and the file, to ask for its size.
    #[cfg(unix)]
    Mapped(Watch, Mmap, File),
    /// A copy.
    Owned(Vec<u8>),
}

impl FileBytes {
    /// Map a file; what cannot be mapped (a pipe, an empty file) is read.
    pub fn open(path: &Path) -> std::io::Result<Self> {
        let mut file = File::open(path)?;
        #[cfg(unix)]
        if let Some(map) = map(&file)
            && let Some(watch) = Watch::over(&map)
        {
            return Ok(Self::Mapped(watch, map, file));
        }
        let mut bytes = Vec::new();
        file.read_to_end(&mut bytes)?;
        Ok(Self::Owned(bytes))
    }

    /// Refuse what was read of a mapping whose file has become shorter; call it after reading.
    ///
    /// # Errors
    /// The end of the file lies before the end of the mapping, or lay there while it was read.
    pub fn require_whole(&self) -> PyResult<()> {
        #[cfg(unix)]
        if let Self::Mapped(watch, map, file) = self {
            let size = file.metadata()?.len();
            if watch.is_cut() || size < map.len() as u64 {
                return Err(from_logs(LogError::Changed { at: size }));
            }
        }
        Ok(())
    }
}

impl AsRef<[u8]> for FileBytes {
    fn as_ref(&self) -> &[u8] {
        match self {
            #[cfg(unix)]
            Self::Mapped(_, map, _) => map,
            Self::Owned(bytes) => bytes,
        }
    }
}

#[cfg(unix)]
fn map(file: &File) -> Option<Mmap> {
    let kind = file.metadata().ok()?;
    if !kind.is_file() || kind.len() == 0 {
        return None;
    }
    // SAFETY: a mapping is only as constant as its file, and no system can promise that for files of
    // others. A process that writes to the file while we read changes the bytes under a shared
    // slice, which Rust does not allow; the readers take nothing from the bytes on trust (every
    // access is checked, no invariant outlives a read), so what comes of it are other numbers. A
    // process that shortens the file takes pages away: `Watch` puts zeros in their place and
    // `require_whole` makes an error of that. Files that are replaced (written aside and renamed)
    // are not affected.
    unsafe { MmapOptions::new().populate().map(file) }.ok()
}
