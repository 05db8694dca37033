//! The Green's function in a file: safetensors, mapped on load, checked by content hash.
//!
//! A store is replaced only by renaming a finished file over it: truncating a mapped file would kill its readers.
#![allow(unsafe_code)] // Mapping a file.

use std::collections::HashMap;
use std::fs::{self, File, OpenOptions};
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::Mutex;

use memmap2::Mmap;
use rayon::prelude::*;
use safetensors::tensor::{Dtype, SafeTensors, TensorView};

use super::key::FORMAT_VERSION;
use super::operator::{GreensFunction, Precision, ValueSlice, Values};
use crate::mesh::{Faces, Surface};
use crate::{Error, Result};

/// Bytes under one checksum.
const CHECKSUM_BLOCK: usize = 1 << 24;
/// Bytes of a checksum (BLAKE3).
const SUM: usize = 32;

/// A store being written beside its place, column by column; [`StoreWriter::finish`] renames it there.
pub struct StoreWriter {
    target: PathBuf,
    beside: PathBuf,
    file: Mutex<File>,
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
    pub fn create(target: &Path, green: &GreensFunction, precision: Precision) -> Result<Self> {
        let io = |source| Error::Io { path: target.to_owned(), source };
        let (column, columns) = (green.rows * precision.bytes(), 3 * green.touch.len());
        let length = column * columns;
        let sums = length.div_ceil(CHECKSUM_BLOCK);
        let small = green.small_tensors();
        let dtype = match precision {
            Precision::F16 => Dtype::I16,
            Precision::F32 => Dtype::F32,
            Precision::F64 => Dtype::F64,
        };
        // The operator first, where it is aligned.
        let mut header = Header::new(green, precision);
        header.tensor("psi", dtype, &[columns, green.rows], length);
        header.tensor("psi_checksums", Dtype::U8, &[sums, SUM], sums * SUM);
        for (name, dtype, shape, data) in &small {
            header.tensor(name, *dtype, shape, data.len());
        }
        let header = header.bytes();
        let at = header.len() as u64;
        let beside = beside(target);
        let file = OpenOptions::new().read(true).write(true).create(true).truncate(true).open(&beside).map_err(io)?;
        let writer =
            Self { target: target.to_owned(), beside, file: Mutex::new(file), at, length, column, finished: false };
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
        let sums = block_sums(&self.beside, self.at, self.length).map_err(|e| self.io(e))?;
        self.write(self.at + self.length as u64, sums.as_flattened())?;
        let synced = self.file.lock().map_err(|_| std::io::Error::other("a writer failed")).and_then(|f| f.sync_all());
        synced.and_then(|()| fs::rename(&self.beside, &self.target)).map_err(|e| self.io(e))?;
        self.finished = true;
        Ok(())
    }

    fn write(&self, at: u64, bytes: &[u8]) -> Result<()> {
        let write = || {
            let mut file = self.file.lock().map_err(|_| std::io::Error::other("a writer failed"))?;
            file.seek(SeekFrom::Start(at))?;
            file.write_all(bytes)
        };
        write().map_err(|e| self.io(e))
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

/// The header of a safetensors file: its length in eight bytes, then JSON, padded so that what follows is aligned.
struct Header {
    fields: serde_json::Map<String, serde_json::Value>,
    end: usize,
}

impl Header {
    fn new(green: &GreensFunction, precision: Precision) -> Self {
        let small = green.small_tensors();
        let metadata = serde_json::json!({
            "format": "palpate-green",
            "version": FORMAT_VERSION.to_string(),
            "key": green.key,
            "precision": precision.name(),
            "youngs_modulus": green.youngs_modulus.map_or(String::new(), |e| format!("{e:e}")),
            "description": green.description,
            "geometry_checksum": small_checksum(small.iter().map(|(_, _, _, b)| b.as_slice())),
        });
        Self { fields: serde_json::Map::from_iter([("__metadata__".to_string(), metadata)]), end: 0 }
    }

    fn tensor(&mut self, name: &str, dtype: Dtype, shape: &[usize], bytes: usize) {
        let offsets = [self.end, self.end + bytes];
        let tensor = serde_json::json!({"dtype": dtype.to_string(), "shape": shape, "data_offsets": offsets});
        self.fields.insert(name.to_string(), tensor);
        self.end += bytes;
    }

    fn bytes(self) -> Vec<u8> {
        let mut json = serde_json::Value::Object(self.fields).to_string().into_bytes();
        json.resize(json.len().next_multiple_of(8), b' ');
        [&(json.len() as u64).to_le_bytes()[..], &json].concat()
    }
}

/// Checksums of the blocks of `length` bytes from byte `at` on. They are read, not mapped: pages of a map that were
/// touched count as memory of the process.
fn block_sums(path: &Path, at: u64, length: usize) -> std::io::Result<Vec<[u8; SUM]>> {
    (0..length.div_ceil(CHECKSUM_BLOCK))
        .into_par_iter()
        .map_init(
            || File::open(path),
            |file, block| {
                let file = file.as_mut().map_err(|e| std::io::Error::new(e.kind(), e.to_string()))?;
                let start = block * CHECKSUM_BLOCK;
                file.seek(SeekFrom::Start(at + start as u64))?;
                let mut hash = blake3::Hasher::new();
                hash.update_reader(file.take(CHECKSUM_BLOCK.min(length - start) as u64))?;
                Ok(*hash.finalize().as_bytes())
            },
        )
        .collect()
}

impl GreensFunction {
    /// Writes the store beside `path` and renames it into place.
    ///
    /// # Errors
    /// The operating system's, with nothing left behind.
    pub fn save(&self, path: &Path) -> Result<()> {
        let writer = StoreWriter::create(path, self, self.values.precision())?;
        writer.put(
            0,
            match self.values.as_slice() {
                ValueSlice::F16(v) => bytemuck::cast_slice(v),
                ValueSlice::F32(v) => bytemuck::cast_slice(v),
                ValueSlice::F64(v) => bytemuck::cast_slice(v),
            },
        )?;
        writer.finish()
    }

    /// The tensors that describe the body, in the order in which they are hashed.
    fn small_tensors(&self) -> Vec<(&'static str, Dtype, Vec<usize>, Vec<u8>)> {
        let bytes = |s: &[u32]| bytemuck::cast_slice(s).to_vec();
        let s = &self.surface;
        let (faces, face_nodes) = (s.faces.as_flattened(), s.faces.nodes_per_face());
        let fixed: Vec<u8> = self.row_is_fixed.iter().map(|&b| u8::from(b)).collect();
        let mut tensors = vec![
            ("surface_nodes", Dtype::U32, vec![self.surface_nodes.len()], bytes(&self.surface_nodes)),
            ("surface_positions", Dtype::F64, vec![s.positions.len(), 3], bytemuck::cast_slice(&s.positions).to_vec()),
            ("surface_faces", Dtype::U32, vec![faces.len() / face_nodes, face_nodes], bytes(faces)),
            ("touch", Dtype::U32, vec![self.touch.len()], bytes(&self.touch)),
            ("fixed_dofs", Dtype::U32, vec![self.fixed_dofs.len()], bytes(&self.fixed_dofs)),
            ("fixed_rows", Dtype::U32, vec![self.fixed_rows.len()], bytes(&self.fixed_rows)),
            ("row_is_fixed", Dtype::U8, vec![fixed.len()], fixed),
        ];
        for (name, values) in [("loads", &self.loads), ("free_response", &self.free_response)] {
            if !values.is_empty() {
                tensors.push((name, Dtype::F64, vec![values.len()], bytemuck::cast_slice(values).to_vec()));
            }
        }
        if !self.scale.is_empty() {
            let scale = bytemuck::cast_slice(&self.scale).to_vec();
            tensors.insert(0, ("scale", Dtype::F64, vec![self.scale.len()], scale));
        }
        tensors
    }

    /// Maps a store and verifies it: format, shapes, the checksum of every block, and `expected_key` if one is given.
    ///
    /// # Errors
    /// [`Error::Store`] that says what does not match, or the operating system's error.
    pub fn load(path: &Path, expected_key: Option<&str>) -> Result<Self> {
        let io = |source| Error::Io { path: path.to_owned(), source };
        let file = File::open(path).map_err(io)?;
        if file.metadata().map_err(io)?.len() == 0 {
            return Err(store_error(path, "is empty"));
        }
        // SAFETY: a store is never written in place (see the module's header), so the mapped bytes do not change.
        let map = unsafe { Mmap::map(&file) }.map_err(io)?;
        let (header, metadata) = SafeTensors::read_metadata(&map)
            .map_err(|e| store_error(path, format!("is not a Palpate store, or is cut short ({e})")))?;
        let metadata = metadata.metadata().clone().unwrap_or_default();
        check_metadata(path, &metadata, expected_key)?;
        let tensors = SafeTensors::deserialize(&map)
            .map_err(|e| store_error(path, format!("is damaged or cut short ({e}); compute it again")))?;
        let reader = Reader { path, tensors: &tensors };
        let mut green = reader.geometry(&metadata)?;
        let (at, len, precision) = reader.verified_values(&green, 8 + header, &map)?;
        green.values = Values::Mapped(map, at, len, precision);
        Ok(green)
    }
}

fn check_metadata(path: &Path, metadata: &HashMap<String, String>, expected_key: Option<&str>) -> Result<()> {
    let field = |name: &str| metadata.get(name).map_or("", String::as_str);
    if field("format") != "palpate-green" {
        return Err(store_error(path, "is not a Palpate Green's function"));
    }
    if field("version") != FORMAT_VERSION.to_string() {
        let version = field("version");
        return Err(store_error(
            path,
            format!("has format version {version}, this program reads {FORMAT_VERSION}; compute it again"),
        ));
    }
    match expected_key {
        Some(key) if key != field("key") => Err(store_error(
            path,
            "was made for another body (mesh, material, supports, loads, touch region or precision differ); compute it again",
        )),
        _ => Ok(()),
    }
}

struct Reader<'a> {
    path: &'a Path,
    tensors: &'a SafeTensors<'a>,
}

impl Reader<'_> {
    fn damaged(&self, what: &str) -> Error {
        store_error(self.path, format!("is damaged ({what}); compute it again"))
    }

    fn tensor(&self, name: &str) -> Result<TensorView<'_>> {
        self.tensors.tensor(name).map_err(|_| self.damaged(&format!("no block '{name}'")))
    }

    fn numbers<T: bytemuck::AnyBitPattern>(&self, name: &str) -> Result<Vec<T>> {
        let view = self.tensor(name)?;
        Ok(view.data().chunks_exact(size_of::<T>()).map(bytemuck::pod_read_unaligned).collect())
    }

    /// Faces of as many nodes as the block has columns.
    fn faces(&self) -> Result<Faces> {
        match self.tensor("surface_faces")?.shape() {
            [_, 3] => Ok(Faces::Linear(self.numbers("surface_faces")?)),
            [_, 6] => Ok(Faces::Quadratic(self.numbers("surface_faces")?)),
            shape => Err(self.damaged(&format!("surface faces of shape {shape:?}"))),
        }
    }

    /// A block that only a loaded body has.
    fn optional(&self, name: &str) -> Result<Vec<f64>> {
        if self.tensors.names().contains(&name) { self.numbers(name) } else { Ok(Vec::new()) }
    }

    fn geometry(&self, metadata: &HashMap<String, String>) -> Result<GreensFunction> {
        let field = |name: &str| metadata.get(name).cloned().unwrap_or_default();
        let positions: Vec<[f64; 3]> = self.numbers("surface_positions")?;
        let positions = positions.into_iter().map(glam::DVec3::from).collect();
        let row_is_fixed: Vec<u8> = self.numbers("row_is_fixed")?;
        let surface_nodes: Vec<u32> = self.numbers("surface_nodes")?;
        let touch: Vec<u32> = self.numbers("touch")?;
        let mut touch_rank = vec![u32::MAX; surface_nodes.len()];
        for (rank, &node) in touch.iter().enumerate() {
            *touch_rank.get_mut(node as usize).ok_or_else(|| self.damaged("touch"))? = rank as u32;
        }
        let green = GreensFunction {
            surface: Surface::new(positions, self.faces()?)?,
            surface_nodes,
            touch,
            touch_rank,
            fixed_dofs: self.numbers("fixed_dofs")?,
            fixed_rows: self.numbers("fixed_rows")?,
            rows: row_is_fixed.len(),
            row_is_fixed: row_is_fixed.into_iter().map(|b| b != 0).collect(),
            values: Values::F64(Vec::new()),
            loads: self.optional("loads")?,
            free_response: self.optional("free_response")?,
            scale: if self.tensors.tensor("scale").is_ok() { self.numbers("scale")? } else { Vec::new() },
            key: field("key"),
            youngs_modulus: field("youngs_modulus").parse().ok(),
            description: field("description"),
            path: Some(self.path.to_owned()),
        };
        let loaded = !green.loads.is_empty() || !green.free_response.is_empty();
        let within = green.surface_nodes.last().is_some_and(|&n| 3 * n as usize + 2 < green.loads.len());
        if loaded && !(within && green.free_response.len() == green.rows) {
            return Err(self.damaged("the loads do not match the body"));
        }
        let small = green.small_tensors();
        if small_checksum(small.iter().map(|(_, _, _, b)| b.as_slice())) != field("geometry_checksum") {
            return Err(self.damaged("the checksum of the geometry differs"));
        }
        Ok(green)
    }

    /// Place, length and format of the operator in the file, every block's checksum verified.
    fn verified_values(
        &self,
        green: &GreensFunction,
        data_start: usize,
        map: &Mmap,
    ) -> Result<(usize, usize, Precision)> {
        let psi = self.tensor("psi")?;
        let precision = match psi.dtype() {
            Dtype::I16 if green.scale.len() == green.rows => Precision::F16,
            Dtype::F32 => Precision::F32,
            Dtype::F64 => Precision::F64,
            other => return Err(self.damaged(&format!("numbers of type {other:?}"))),
        };
        if psi.shape() != [3 * green.touch.len(), green.rows] {
            return Err(self.damaged("the operator's shape does not match the body"));
        }
        let at = psi.data().as_ptr() as usize - map.as_ptr() as usize;
        debug_assert!(at >= data_start);
        if !(psi.data().as_ptr() as usize).is_multiple_of(precision.bytes()) {
            return Err(self.damaged("the operator is not aligned"));
        }
        let checksums = self.tensor("psi_checksums")?;
        if checksums.data().len() != SUM * psi.data().len().div_ceil(CHECKSUM_BLOCK) {
            return Err(self.damaged("checksums are missing"));
        }
        let io = |source| Error::Io { path: self.path.to_owned(), source };
        let sums = block_sums(self.path, at as u64, psi.data().len()).map_err(io)?;
        for (i, (found, stored)) in sums.iter().zip(checksums.data().chunks_exact(SUM)).enumerate() {
            if found != stored {
                return Err(self.damaged(&format!("checksum of block {i} differs")));
            }
        }
        Ok((at, 3 * green.touch.len() * green.rows, precision))
    }
}

fn small_checksum<'a>(tensors: impl Iterator<Item = &'a [u8]>) -> String {
    let mut hash = blake3::Hasher::new();
    for bytes in tensors {
        hash.update(&(bytes.len() as u64).to_le_bytes());
        hash.update(bytes);
    }
    hash.finalize().to_hex().to_string()
}

fn beside(path: &Path) -> PathBuf {
    let mut name = path.file_name().unwrap_or_default().to_os_string();
    name.push(format!(".{}.new", std::process::id()));
    path.with_file_name(name)
}

fn store_error(path: &Path, reason: impl Into<String>) -> Error {
    Error::Store { path: path.to_owned(), reason: reason.into() }
}
