//! The bytes of a log file: mapped where the system can, else read.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use memmap2::{Mmap, MmapOptions};
use pyo3::prelude::*;

use flightid_logs::LogError;

use crate::error::from_logs;

/// Bytes that stay as they are as long as nobody writes to the file.
pub enum FileBytes {
    /// Pages of the file itself, and the file, to ask for its size.
    Mapped(Mmap, File),
    /// A copy.
    Owned(Vec<u8>),
}

impl FileBytes {
    /// Map a file; what cannot be mapped (a pipe, an empty file) is read.
    pub fn open(path: &Path) -> std::io::Result<Self> {
        let mut file = File::open(path)?;
        if let Some(map) = map(&file) {
            return Ok(Self::Mapped(map, file));
        }
        let mut bytes = Vec::new();
        file.read_to_end(&mut bytes)?;
        Ok(Self::Owned(bytes))
    }

    /// Refuse to touch a mapping whose file has become shorter.
    ///
    /// # Errors
    /// The end of the file lies before the end of the mapping.
    pub fn require_whole(&self) -> PyResult<()> {
        if let Self::Mapped(map, file) = self {
            let size = file.metadata()?.len();
            if size < map.len() as u64 {
                return Err(from_logs(LogError::Changed { at: size }));
            }
        }
        Ok(())
    }
}

impl AsRef<[u8]> for FileBytes {
    fn as_ref(&self) -> &[u8] {
        match self {
            Self::Mapped(map, _) => map,
            Self::Owned(bytes) => bytes,
        }
    }
}

fn map(file: &File) -> Option<Mmap> {
    let kind = file.metadata().ok()?;
    if !kind.is_file() || kind.len() == 0 {
        return None;
    }
    // SAFETY: a mapping is only as constant as its file, and no system can promise that for files of
    // others. A process that writes to the file while we read changes the bytes under a shared
    // slice, which Rust does not allow; the readers take nothing from the bytes on trust (every
    // access is checked, no invariant outlives a read), so what comes of it are other numbers. A
    // process that shortens the file takes pages away: reading them ends this process with SIGBUS.
    // `require_whole` turns that into an error where the file was cut before a call; a cut during a
    // call remains. Files that are replaced (written aside and renamed) are not affected.
    unsafe { MmapOptions::new().populate().map(file) }.ok()
}
