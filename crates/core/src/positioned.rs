//! Reading and writing at a position of a file, by the call that each system has for it, and reading of bytes in memory.

use std::fs::File;
use std::io;
use std::sync::Arc;

/// What is read by position: a file, or bytes in memory where there is no file system.
pub(crate) enum Source {
    /// A file that is open.
    File(File),
    /// Bytes of a file that was provided: see [`crate::files::provide`].
    Memory(Arc<[u8]>),
}

impl Source {
    /// Length, bytes.
    ///
    /// # Errors
    /// The operating system's.
    pub fn length(&self) -> io::Result<u64> {
        match self {
            Source::File(file) => Ok(file.metadata()?.len()),
            Source::Memory(bytes) => Ok(bytes.len() as u64),
        }
    }
}

/// Bytes at positions; a file's own position does not matter and may change.
pub(crate) trait Positioned {
    /// Fills `out` with the bytes from `at` on.
    ///
    /// # Errors
    /// Fewer bytes than that (`UnexpectedEof`), or the operating system's.
    fn read_exact_at(&self, out: &mut [u8], at: u64) -> io::Result<()>;

    /// Writes all bytes from `at` on.
    ///
    /// # Errors
    /// The operating system's.
    fn write_all_at(&self, bytes: &[u8], at: u64) -> io::Result<()>;
}

impl Positioned for Source {
    fn read_exact_at(&self, out: &mut [u8], at: u64) -> io::Result<()> {
        match self {
            Source::File(file) => file.read_exact_at(out, at),
            Source::Memory(bytes) => {
                let from = usize::try_from(at).map_err(|_| io::ErrorKind::UnexpectedEof)?;
                let piece = from.checked_add(out.len()).and_then(|to| bytes.get(from..to));
                out.copy_from_slice(piece.ok_or(io::ErrorKind::UnexpectedEof)?);
                Ok(())
            }
        }
    }

    fn write_all_at(&self, bytes: &[u8], at: u64) -> io::Result<()> {
        match self {
            Source::File(file) => file.write_all_at(bytes, at),
            Source::Memory(_) => Err(io::ErrorKind::Unsupported.into()),
        }
    }
}

#[cfg(unix)]
impl Positioned for File {
    fn read_exact_at(&self, out: &mut [u8], at: u64) -> io::Result<()> {
        std::os::unix::fs::FileExt::read_exact_at(self, out, at)
    }

    fn write_all_at(&self, bytes: &[u8], at: u64) -> io::Result<()> {
        std::os::unix::fs::FileExt::write_all_at(self, bytes, at)
    }
}

#[cfg(windows)]
impl Positioned for File {
    fn read_exact_at(&self, mut out: &mut [u8], mut at: u64) -> io::Result<()> {
        while !out.is_empty() {
            match std::os::windows::fs::FileExt::seek_read(self, out, at) {
                Ok(0) => return Err(io::ErrorKind::UnexpectedEof.into()),
                Ok(count) => (out, at) = (&mut out[count..], at + count as u64),
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(error) => return Err(error),
            }
        }
        Ok(())
    }

    fn write_all_at(&self, mut bytes: &[u8], mut at: u64) -> io::Result<()> {
        while !bytes.is_empty() {
            match std::os::windows::fs::FileExt::seek_write(self, bytes, at) {
                Ok(0) => return Err(io::ErrorKind::WriteZero.into()),
                Ok(count) => (bytes, at) = (&bytes[count..], at + count as u64),
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(error) => return Err(error),
            }
        }
        Ok(())
    }
}

/// A system without files, as in a browser.
#[cfg(not(any(unix, windows)))]
impl Positioned for File {
    fn read_exact_at(&self, _out: &mut [u8], _at: u64) -> io::Result<()> {
        Err(io::ErrorKind::Unsupported.into())
    }

    fn write_all_at(&self, _bytes: &[u8], _at: u64) -> io::Result<()> {
        Err(io::ErrorKind::Unsupported.into())
    }
}
