//! The Green's function in a file: safetensors, mapped on load, checked by content hash.
//!
//! A store is replaced only by renaming a finished file over it: truncating a mapped file would kill its readers.
#![allow(unsafe_code)] // Mapping a file.

use std::collections::HashMap;
use std::fs::{self, File};
use std::path::{Path, PathBuf};

use memmap2::Mmap;
use safetensors::tensor::{Dtype, SafeTensors, TensorView};

use super::key::FORMAT_VERSION;
use super::operator::{GreensFunction, Precision, ValueSlice, Values};
use crate::mesh::{Faces, Surface};
use crate::{Error, Result};

/// Bytes under one checksum.
const CHECKSUM_BLOCK: usize = 1 << 24;

impl GreensFunction {
    /// Writes the store beside `path` and renames it into place.
    ///
    /// # Errors
    /// The operating system's, with nothing left behind.
    pub fn save(&self, path: &Path) -> Result<()> {
        let io = |source| Error::Io { path: path.to_owned(), source };
        let partial = partial_path(path);
        let result = self.write(&partial).and_then(|()| {
            File::open(&partial).and_then(|f| f.sync_all()).map_err(io)?;
            fs::rename(&partial, path).map_err(io)
        });
        result.map_err(|error| {
            let _ = fs::remove_file(&partial);
            match error {
                // The user knows the file asked for, not the one beside it.
                Error::Io { source, .. } => io(source),
                other => other,
            }
        })
    }

    fn write(&self, path: &Path) -> Result<()> {
        let (bytes, dtype): (&[u8], Dtype) = match self.values.as_slice() {
            ValueSlice::F32(v) => (bytemuck::cast_slice(v), Dtype::F32),
            ValueSlice::F64(v) => (bytemuck::cast_slice(v), Dtype::F64),
        };
        let small = self.small_tensors();
        let checksums: Vec<u8> = bytes.chunks(CHECKSUM_BLOCK).flat_map(|c| *blake3::hash(c).as_bytes()).collect();
        let metadata = HashMap::from([
            ("format".to_string(), "palpate-green".to_string()),
            ("version".to_string(), FORMAT_VERSION.to_string()),
            ("key".to_string(), self.key.clone()),
            ("precision".to_string(), self.values.precision().name().to_string()),
            ("youngs_modulus".to_string(), self.youngs_modulus.map_or(String::new(), |e| format!("{e:e}"))),
            ("description".to_string(), self.description.clone()),
            ("geometry_checksum".to_string(), small_checksum(small.iter().map(|(_, _, _, b)| b.as_slice()))),
        ]);
        let broken = |e: safetensors::SafeTensorError| match e {
            safetensors::SafeTensorError::IoError(source) => Error::Io { path: path.to_owned(), source },
            other => store_error(path, format!("cannot be written: {other}")),
        };
        let mut views = Vec::new();
        for (name, dtype, shape, data) in &small {
            views.push((*name, TensorView::new(*dtype, shape.clone(), data).map_err(broken)?));
        }
        let columns = 3 * self.touch.len();
        views.push(("psi", TensorView::new(dtype, vec![columns, self.rows], bytes).map_err(broken)?));
        let blocks = checksums.len() / 32;
        views.push(("psi_checksums", TensorView::new(Dtype::U8, vec![blocks, 32], &checksums).map_err(broken)?));
        safetensors::serialize_to_file(views, Some(metadata), path).map_err(broken)
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
            Dtype::F32 => Precision::F32,
            Dtype::F64 => Precision::F64,
            other => return Err(self.damaged(&format!("numbers of type {other:?}"))),
        };
        if psi.shape() != [3 * green.touch.len(), green.rows] {
            return Err(self.damaged("the operator's shape does not match the body"));
        }
        let checksums = self.tensor("psi_checksums")?;
        let blocks = psi.data().chunks(CHECKSUM_BLOCK);
        if checksums.data().len() != 32 * blocks.len() {
            return Err(self.damaged("checksums are missing"));
        }
        for (i, (block, sum)) in blocks.zip(checksums.data().chunks_exact(32)).enumerate() {
            if blake3::hash(block).as_bytes() != sum {
                return Err(self.damaged(&format!("checksum of block {i} differs")));
            }
        }
        let at = psi.data().as_ptr() as usize - map.as_ptr() as usize;
        debug_assert!(at >= data_start);
        let aligned = match precision {
            Precision::F32 => bytemuck::try_cast_slice::<u8, f32>(psi.data()).is_ok(),
            Precision::F64 => bytemuck::try_cast_slice::<u8, f64>(psi.data()).is_ok(),
        };
        if !aligned {
            return Err(self.damaged("the operator is not aligned"));
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

fn partial_path(path: &Path) -> PathBuf {
    let mut name = path.file_name().unwrap_or_default().to_os_string();
    name.push(format!(".{}.partial", std::process::id()));
    path.with_file_name(name)
}

fn store_error(path: &Path, reason: impl Into<String>) -> Error {
    Error::Store { path: path.to_owned(), reason: reason.into() }
}
