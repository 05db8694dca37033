//! Writing a Green's function: safetensors, with checksums, beside its place and then renamed.
//!
//! A store is replaced only by renaming a finished file over it: readers keep the file they have opened.

use std::fs::{self, File, OpenOptions};
use std::path::{Path, PathBuf};

use safetensors::tensor::Dtype;

use super::checksums::{ColumnHeads, SUM, block_count, sums_keeping_heads};
use super::function::GreensFunction;
use super::key::{FORMAT_VERSION, add_sections};
use super::precision::Precision;
use crate::header::Header;
use crate::positioned::Positioned;
use crate::{Error, Result};

/// Name, type, shape and bytes of a tensor that describes the body.
pub type SmallTensor = (&'static str, Dtype, Vec<usize>, Vec<u8>);

/// A store being written beside its place, column by column; [`StoreWriter::finish`] renames it there.
pub struct StoreWriter {
    target: PathBuf,
    beside: PathBuf,
    file: File,
    /// First byte of the operator, its length, and bytes of a column.
    at: u64,
    length: usize,
    column: usize,
    finished: bool,
}

impl StoreWriter {
    /// Writes everything but the operator.
    ///
    /// # Errors
    /// The operating system's, with nothing left behind.
    pub fn create(target: &Path, green: &GreensFunction) -> Result<Self> {
        let precision = green.precision();
        let io = |source| Error::Io { path: target.to_owned(), source };
        let (column, columns) = (green.rows * precision.bytes(), 3 * green.touch.len());
        let length = column * columns;
        let sums = block_count(length);
        let small = green.small_tensors();
        let dtype = match precision {
            Precision::F16 => Dtype::I16,
            Precision::F32 => Dtype::F32,
            Precision::F64 => Dtype::F64,
        };
        // The operator first, where it is aligned.
        let mut header = header_of(green, precision);
        header.tensor("psi", dtype, &[columns, green.rows], length);
        header.tensor("psi_checksums", Dtype::U8, &[sums, SUM], sums * SUM);
        for (name, dtype, shape, data) in &small {
            header.tensor(name, *dtype, shape, data.len());
        }
        let header = header.bytes();
        let at = header.len() as u64;
        let beside = beside(target);
        let file = OpenOptions::new().read(true).write(true).create(true).truncate(true).open(&beside).map_err(io)?;
        let writer = Self { target: target.to_owned(), beside, file, at, length, column, finished: false };
        writer.write(0, &header)?;
        let mut place = at + (length + sums * SUM) as u64;
        for (_, _, _, data) in &small {
            writer.write(place, data)?;
            place += data.len() as u64;
        }
        Ok(writer)
    }

    /// Writes consecutive columns, from `column` on.
    ///
    /// # Errors
    /// The operating system's.
    pub fn put(&self, column: usize, bytes: &[u8]) -> Result<()> {
        self.write(self.at + (column * self.column) as u64, bytes)
    }

    /// Adds the checksums and renames the file into its place.
    ///
    /// # Errors
    /// The operating system's, with nothing left behind.
    pub fn finish(mut self) -> Result<()> {
        let sums = sums_keeping_heads(&self.file, self.at, self.length, &ColumnHeads::default(), &mut [])
            .map_err(|e| self.io(e))?;
        self.write(self.at + self.length as u64, sums.as_flattened())?;
        self.file.sync_all().and_then(|()| fs::rename(&self.beside, &self.target)).map_err(|e| self.io(e))?;
        self.finished = true;
        Ok(())
    }

    fn write(&self, at: u64, bytes: &[u8]) -> Result<()> {
        self.file.write_all_at(bytes, at).map_err(|e| self.io(e))
    }

    /// The user knows the file asked for, not the one beside it.
    fn io(&self, source: std::io::Error) -> Error {
        Error::Io { path: self.target.clone(), source }
    }
}

impl Drop for StoreWriter {
    fn drop(&mut self) {
        if !self.finished {
            let _ = fs::remove_file(&self.beside);
        }
    }
}

impl GreensFunction {
    /// Writes the store beside `path` and renames it into place.
    ///
    /// # Errors
    /// The operating system's, with nothing left behind.
    pub fn save(&self, path: &Path) -> Result<()> {
        let writer = StoreWriter::create(path, self)?;
        self.entries.each_bytes(&mut |column, bytes| writer.put(column, bytes))?;
        writer.finish()
    }

    /// The tensors that describe the body, in the order in which they are hashed.
    pub(super) fn small_tensors(&self) -> Vec<SmallTensor> {
        let bytes = |s: &[u32]| bytemuck::cast_slice(s).to_vec();
        let s = &self.surface;
        let (faces, face_nodes) = (s.faces.as_flattened(), s.faces.nodes_per_face());
        let fixed: Vec<u8> = self.row_is_fixed.iter().map(|&b| u8::from(b)).collect();
        let stored = self.entries.node_order.nodes();
        let mut tensors = vec![
            ("surface_nodes", Dtype::U32, vec![self.surface_nodes.len()], bytes(&self.surface_nodes)),
            ("surface_positions", Dtype::F64, vec![s.positions.len(), 3], bytemuck::cast_slice(&s.positions).to_vec()),
            ("surface_faces", Dtype::U32, vec![faces.len() / face_nodes, face_nodes], bytes(faces)),
            ("touch", Dtype::U32, vec![self.touch.len()], bytes(&self.touch)),
            ("stored_nodes", Dtype::U32, vec![stored.len()], bytes(stored)),
            ("fixed_dofs", Dtype::U32, vec![self.fixed_dofs.len()], bytes(&self.fixed_dofs)),
            ("fixed_rows", Dtype::U32, vec![self.fixed_rows.len()], bytes(&self.fixed_rows)),
            ("row_is_fixed", Dtype::U8, vec![fixed.len()], fixed),
        ];
        for (name, values) in [("loads", &self.loads), ("free_response", &self.free_response)] {
            if !values.is_empty() {
                tensors.push((name, Dtype::F64, vec![values.len()], bytemuck::cast_slice(values).to_vec()));
            }
        }
        let magnitude = &self.entries.magnitude;
        let accuracy = self.accuracy.to_array();
        tensors.push(("accuracy", Dtype::F64, vec![accuracy.len()], bytemuck::cast_slice(&accuracy).to_vec()));
        tensors.insert(0, ("magnitude", Dtype::F64, vec![magnitude.len()], bytemuck::cast_slice(magnitude).to_vec()));
        tensors
    }
}

/// One sum of all of them.
pub fn small_checksum(tensors: &[SmallTensor]) -> String {
    let mut hash = blake3::Hasher::new();
    add_sections(&mut hash, tensors.iter().map(|(_, _, _, bytes)| &bytes[..]));
    hash.finalize().to_hex().to_string()
}

fn beside(path: &Path) -> PathBuf {
    let mut name = path.file_name().unwrap_or_default().to_os_string();
    name.push(format!(".{}.new", std::process::id()));
    path.with_file_name(name)
}

/// The header of a store without its tensors.
pub(super) fn header_of(green: &GreensFunction, precision: Precision) -> Header {
    Header::new([
        ("format", "palpate-green".into()),
        ("version", FORMAT_VERSION.to_string()),
        ("key", green.key.clone()),
        ("precision", precision.name().into()),
        ("youngs_modulus", green.youngs_modulus.map_or(String::new(), |e| format!("{e:e}"))),
        ("description", green.description.clone()),
        ("geometry_checksum", small_checksum(&green.small_tensors())),
    ])
}
