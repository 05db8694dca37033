//! Reading a Green's function from its file: verified as a whole, or refused.
//!
//! Everything is read by position into memory of our own, checksums are taken of the bytes that are kept, and nothing is
//! mapped. A file that somebody cuts short later cannot kill the process by SIGBUS:
//!
//! - An operator of up to [`RESIDENT_BYTES`] is held as a whole; its file is not looked at again.
//! - Of a larger one the square of touchable rows and columns is held, all that a force tick reads, and present from the
//!   start whether or not the system lets memory be locked. Frames and solves read whole columns from the file, which stays
//!   open (a file renamed over it changes nothing); they compare its length first ([`GreensFunction::require_intact`]). A
//!   file that shrinks between that comparison and the reading yields NaN. Its checksums are not taken again: bytes that
//!   somebody overwrites in place, at the same length, are not noticed.

use std::path::Path;

use safetensors::tensor::{Dtype, Metadata, TensorInfo};

use super::accuracy::Accuracy;
use super::checksums::{ColumnHeads, SUM, block_count, sums_keeping_heads, sums_while_reading};
use super::columns_file::ColumnsFile;
use super::entries::Entries;
use super::function::GreensFunction;
use super::key::FORMAT_VERSION;
use super::node_order::NodeOrder;
use super::numbers::Numbers;
use super::packed;
use super::precision::Precision;
use super::store_writer::small_checksum;
use crate::files::open;
use crate::header::{HEADER_BYTES, is_sealed};
use crate::mesh::{Faces, Surface};
use crate::positioned::{Positioned, Source};
use crate::{Error, Result};

/// Largest operator that is held in memory as a whole, bytes. All of the built-in bodies are far below; beyond, a process
/// should not take memory that only frames need.
const RESIDENT_BYTES: usize = 2 << 30;

impl GreensFunction {
    /// Reads a store and verifies it: format, shapes, the checksum of every block, and `expected_key` if one is given.
    ///
    /// # Errors
    /// [`Error::Store`] that says what does not match, or the operating system's error.
    pub fn load(path: &Path, expected_key: Option<&str>) -> Result<Self> {
        load_within(path, expected_key, RESIDENT_BYTES)
    }
}

/// Key and touchable nodes of the store at `path`; `None` where there is none of this version. Only its head is read: the
/// blocks are not verified.
#[cfg(feature = "offline")]
pub fn touch_of_store(path: &Path) -> Option<(String, Vec<u32>)> {
    let reader = Reader::open(path).ok()?;
    reader.check_texts(None).ok()?;
    Some((reader.text("key").to_string(), reader.numbers("touch").ok()?))
}

/// Holds operators of up to `resident_bytes` as a whole.
fn load_within(path: &Path, expected_key: Option<&str>, resident_bytes: usize) -> Result<GreensFunction> {
    let reader = Reader::open(path)?;
    reader.check_texts(expected_key)?;
    reader.green(resident_bytes)
}

struct Reader<'a> {
    path: &'a Path,
    file: Source,
    /// Bytes of the file.
    length: u64,
    /// Whether the header is as it was written.
    sealed: bool,
    tensors: Metadata,
    /// First byte of the tensors.
    start: u64,
}

impl<'a> Reader<'a> {
    /// Opens a file and reads its header.
    fn open(path: &'a Path) -> Result<Self> {
        let io = |source| Error::Io { path: path.to_owned(), source };
        let file = open(path).map_err(io)?;
        let length = file.length().map_err(io)?;
        if length == 0 {
            return Err(Error::store(path, "is empty"));
        }
        let foreign = || Error::store(path, "is not a Palpate store, or is cut short; compute it again");
        let mut count = [0; 8];
        file.read_exact_at(&mut count, 0).map_err(|_| foreign())?;
        let count = u64::from_le_bytes(count);
        if count > HEADER_BYTES.min(length) {
            return Err(foreign());
        }
        let mut head = vec![0; 8 + count as usize];
        file.read_exact_at(&mut head, 0).map_err(|_| foreign())?;
        let tensors: Metadata = serde_json::from_slice(&head[8..]).map_err(|_| foreign())?;
        let start = 8 + count;
        if start + tensors.data_len() as u64 != length {
            return Err(foreign());
        }
        Ok(Self { path, file, length, sealed: is_sealed(&head), tensors, start })
    }

    /// A text of the header; empty where there is none.
    fn text(&self, name: &str) -> &str {
        self.tensors.metadata().as_ref().and_then(|texts| texts.get(name)).map_or("", String::as_str)
    }

    fn check_texts(&self, expected_key: Option<&str>) -> Result<()> {
        if self.text("format") != "palpate-green" {
            return Err(Error::store(self.path, "is not a Palpate Green's function"));
        }
        let version = self.text("version");
        if version != FORMAT_VERSION.to_string() {
            let reason = format!("has format version {version}, this program reads {FORMAT_VERSION}; compute it again");
            return Err(Error::store(self.path, reason));
        }
        if !self.sealed {
            return Err(self.damaged("the checksum of its header differs"));
        }
        match expected_key {
            Some(key) if key != self.text("key") => Err(Error::store(
                self.path,
                "was made for another body (mesh, material, supports, loads, touch region or precision differ); \
                compute it again",
            )),
            _ => Ok(()),
        }
    }

    fn damaged(&self, what: &str) -> Error {
        Error::store(self.path, format!("is damaged ({what}); compute it again"))
    }

    fn io(&self, source: std::io::Error) -> Error {
        Error::Io { path: self.path.to_owned(), source }
    }

    fn tensor(&self, name: &str) -> Result<&TensorInfo> {
        self.tensors.info(name).ok_or_else(|| self.damaged(&format!("no block '{name}'")))
    }

    fn bytes(&self, name: &str) -> Result<Vec<u8>> {
        let (from, to) = self.tensor(name)?.data_offsets;
        let mut bytes = vec![0; to - from];
        self.file.read_exact_at(&mut bytes, self.start + from as u64).map_err(|e| self.io(e))?;
        Ok(bytes)
    }

    fn numbers<T: bytemuck::AnyBitPattern>(&self, name: &str) -> Result<Vec<T>> {
        Ok(self.bytes(name)?.chunks_exact(size_of::<T>()).map(bytemuck::pod_read_unaligned).collect())
    }

    /// Faces of as many nodes as the block has columns.
    fn faces(&self) -> Result<Faces> {
        match self.tensor("surface_faces")?.shape[..] {
            [_, 3] => Ok(Faces::Linear(self.numbers("surface_faces")?)),
            [_, 6] => Ok(Faces::Quadratic(self.numbers("surface_faces")?)),
            ref shape => Err(self.damaged(&format!("surface faces of shape {shape:?}"))),
        }
    }

    /// A block that not every store has.
    fn optional(&self, name: &str) -> Result<Vec<f64>> {
        if self.tensors.info(name).is_some() { self.numbers(name) } else { Ok(Vec::new()) }
    }

    fn green(self, resident_bytes: usize) -> Result<GreensFunction> {
        let positions: Vec<[f64; 3]> = self.numbers("surface_positions")?;
        let positions = positions.into_iter().map(glam::DVec3::from).collect();
        let row_is_fixed: Vec<u8> = self.numbers("row_is_fixed")?;
        let row_is_fixed: Vec<bool> = row_is_fixed.into_iter().map(|b| b != 0).collect();
        let surface_nodes: Vec<u32> = self.numbers("surface_nodes")?;
        let touch: Vec<u32> = self.numbers("touch")?;
        let node_order = NodeOrder::from_nodes(self.numbers("stored_nodes")?, &touch);
        let node_order = node_order.filter(|node_order| node_order.nodes().len() == surface_nodes.len());
        let node_order = node_order.ok_or_else(|| self.damaged("the order of the nodes"))?;
        if row_is_fixed.len() < 3 * surface_nodes.len() {
            return Err(self.damaged("rows are missing"));
        }
        let precision = self.precision()?;
        let magnitude: Vec<f64> = self.numbers("magnitude")?;
        if magnitude.len() != row_is_fixed.len() {
            return Err(self.damaged("the magnitudes do not match the operator"));
        }
        let accuracy = Accuracy::from_slice(&self.numbers::<f64>("accuracy")?);
        let accuracy = accuracy.ok_or_else(|| self.damaged("its accuracy"))?;
        let entries = Entries::new(node_order, &row_is_fixed, magnitude, Numbers::zeros(precision, 0), None);
        let mut green = GreensFunction {
            surface: Surface::new(positions, self.faces()?)?,
            surface_nodes,
            touch,
            fixed_dofs: self.numbers("fixed_dofs")?,
            fixed_rows: self.numbers("fixed_rows")?,
            rows: row_is_fixed.len(),
            row_is_fixed,
            entries,
            accuracy,
            loads: self.optional("loads")?,
            free_response: self.optional("free_response")?,
            key: self.text("key").into(),
            youngs_modulus: self.text("youngs_modulus").parse().ok(),
            description: self.text("description").into(),
            path: Some(self.path.to_owned()),
        };
        let loaded = !green.loads.is_empty() || !green.free_response.is_empty();
        let within = green.surface_nodes.last().is_some_and(|&n| 3 * n as usize + 2 < green.loads.len());
        if loaded && !(within && green.free_response.len() == green.rows) {
            return Err(self.damaged("the loads do not match the body"));
        }
        if small_checksum(&green.small_tensors()) != self.text("geometry_checksum") {
            return Err(self.damaged("the checksum of the geometry differs"));
        }
        green.entries = match self.is_packed() {
            true => self.packed_entries(&green, precision)?,
            false => self.entries(&green, precision, resident_bytes)?,
        };
        Ok(green)
    }

    fn precision(&self) -> Result<Precision> {
        if self.is_packed() {
            return Precision::parse(self.text("precision")).ok_or_else(|| self.damaged("the type of its numbers"));
        }
        match self.tensor("psi")?.dtype {
            Dtype::I16 => Ok(Precision::F16),
            Dtype::F32 => Ok(Precision::F32),
            Dtype::F64 => Ok(Precision::F64),
            other => Err(self.damaged(&format!("numbers of type {other:?}"))),
        }
    }

    fn is_packed(&self) -> bool {
        self.tensors.info(packed::BLOCK).is_some()
    }

    /// What a packed store holds of the operator: rows of the surface.
    fn packed_entries(&self, green: &GreensFunction, precision: Precision) -> Result<Entries> {
        let damaged = || Error::store(self.path, "is damaged (its packed numbers); write it again");
        let block = self.bytes(packed::BLOCK)?;
        if blake3::hash(&block).to_hex().as_str() != self.text(packed::SUM) {
            return Err(damaged());
        }
        let rows = 3 * green.surface_nodes.len();
        let numbers = Numbers::try_zeros(precision, 3 * green.touch.len() * rows)?;
        let (node_order, magnitude) = (green.entries.node_order.clone(), green.entries.magnitude[..rows].to_vec());
        let mut entries = Entries::new(node_order, &green.row_is_fixed[..rows], magnitude, numbers, None);
        entries.unpack(&block).ok_or_else(damaged)?;
        Ok(entries)
    }

    /// Reads what is held of the operator, the checksum of every block verified.
    fn entries(self, green: &GreensFunction, precision: Precision, resident_bytes: usize) -> Result<Entries> {
        let (psi, columns) = (self.tensor("psi")?, 3 * green.touch.len());
        if psi.shape != [columns, green.rows] {
            return Err(self.damaged("the operator's shape does not match the body"));
        }
        let (node_order, magnitude) = (green.entries.node_order.clone(), green.entries.magnitude.to_vec());
        let at = self.start + psi.data_offsets.0 as u64;
        let (column, head) = (green.rows * precision.bytes(), columns * precision.bytes());
        let length = columns * column;
        let whole = length <= resident_bytes;
        let mut numbers = Numbers::try_zeros(precision, columns * if whole { green.rows } else { columns })?;
        let bytes = numbers.bytes_mut();
        let sums = match whole {
            true => sums_while_reading(&self.file, at, bytes),
            false => sums_keeping_heads(&self.file, at, length, &ColumnHeads { column, head }, bytes),
        };
        self.compare(length, &sums.map_err(|e| self.io(e))?)?;
        let Self { file, length, .. } = self;
        let path = self.path.to_owned();
        let file = (!whole).then_some(ColumnsFile { file, path, length, at, column });
        Ok(Entries::new(node_order, &green.row_is_fixed, magnitude, numbers, file))
    }

    /// Compares sums with those that were written down.
    fn compare(&self, length: usize, sums: &[[u8; SUM]]) -> Result<()> {
        let written = self.bytes("psi_checksums")?;
        if written.len() != SUM * block_count(length) {
            return Err(self.damaged("checksums are missing"));
        }
        match sums.iter().zip(written.chunks_exact(SUM)).position(|(found, written)| found != written) {
            Some(block) => Err(self.damaged(&format!("checksum of block {block} differs"))),
            None => Ok(()),
        }
    }
}

#[cfg(all(test, feature = "offline"))]
mod tests {
    use std::fs::{OpenOptions, remove_file};
    use std::path::PathBuf;

    use glam::DVec3;

    use super::*;
    use crate::fem::{Isotropic, Supports};
    use crate::green::{Problem, TouchNode, precompute};
    use crate::mesh::TetMesh;

    /// Three tetrahedra in a row on a clamped face, not all of it touchable, in a file of its own.
    fn stored(name: &str, precision: Precision) -> (GreensFunction, PathBuf) {
        let nodes =
            [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.1, 0.1, 1.0], [1.0, 0.9, 1.1], [0.2, 1.0, 2.0]];
        let faces = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 4], [1, 4, 3], [2, 5, 4], [2, 3, 5], [3, 4, 5]];
        let tets = vec![[0, 1, 2, 3], [1, 2, 3, 4], [2, 3, 4, 5]];
        let mesh = TetMesh::new(nodes.map(DVec3::from).to_vec(), tets).expect("a valid mesh");
        let problem = Problem {
            materials: vec![Isotropic::new(10e3, 0.4, 1000.0).expect("a valid material"); 3],
            supports: Supports::new(18, (0..9).collect()).expect("valid supports"),
            surface_nodes: (0..6).collect(),
            surface_faces: faces.to_vec().into(),
            touch: vec![2, 3, 5],
            loads: Vec::new(),
            mesh,
        };
        let green = precompute(&problem, precision, &|_, _| true).expect("a supported body");
        let path = std::env::temp_dir().join(format!("palpate-{}-{name}-{}", std::process::id(), precision.name()));
        green.save(&path).expect("a writable folder");
        (green, path)
    }

    fn cut(path: &Path) {
        let file = OpenOptions::new().write(true).open(path).expect("the store");
        file.set_len(100).expect("a file that can be cut");
    }

    fn patch(green: &GreensFunction) -> Vec<TouchNode> {
        [3, 5].map(|node| green.touchable(node).expect("a touchable node")).to_vec()
    }

    fn moved(green: &GreensFunction) -> Vec<f64> {
        let mut moved = vec![0.0; 18];
        green.add_forces(
            &patch(green).into_iter().map(|c| (c, DVec3::new(1.0, -2.0, 0.5))).collect::<Vec<_>>(),
            &mut moved,
        );
        moved
    }

    #[test]
    fn columns_in_the_file_answer_as_those_in_memory() {
        for precision in [Precision::F16, Precision::F32, Precision::F64] {
            let (green, path) = stored("columns", precision);
            for bound in [usize::MAX, 0] {
                let loaded = load_within(&path, Some(&green.key), bound).expect("a good store");
                assert_eq!((loaded.is_resident(0), loaded.is_resident(3)), (bound > 0, true));
                for (row, column) in (0..18).flat_map(|row| (0..9).map(move |column| (row, column))) {
                    assert_eq!(loaded.entry(row, column), green.entry(row, column), "row {row}, column {column}");
                }
                assert_eq!(moved(&loaded), moved(&green));
                let (mut a, mut b) = (vec![1.0; 18], vec![1.0; 18]);
                loaded.add_column(7, 3.0, &mut a);
                green.add_column(7, 3.0, &mut b);
                assert_eq!(a, b);
                let (mut a, mut b) = (vec![0.0; 6 * 18], vec![0.0; 6 * 18]);
                loaded.block(&[0, 1, 2, 3, 4, 5], &patch(&loaded), &mut a);
                green.block(&[0, 1, 2, 3, 4, 5], &patch(&green), &mut b);
                assert_eq!(a, b);
                let mean =
                    |green: &GreensFunction| green.weighted_block(&[4, 3], &[0.7, 0.3], &patch(green), &[0.4, 0.6]);
                let largest = mean(&green).to_cols_array().into_iter().fold(0.0f64, |m, x| m.max(x.abs()));
                let difference = (mean(&loaded) - mean(&green)).to_cols_array();
                assert!(difference.into_iter().all(|x| x.abs() <= 1e-15 * largest));
                let copy = path.with_extension("copy");
                loaded.save(&copy).expect("a writable folder");
                assert!(std::fs::read(&copy).expect("the copy") == std::fs::read(&path).expect("the store"));
                remove_file(copy).expect("the copy");
            }
            remove_file(path).expect("the store");
        }
    }

    #[test]
    fn a_file_cut_short_in_use_is_refused_and_contacts_go_on() {
        for precision in [Precision::F16, Precision::F32, Precision::F64] {
            let (green, path) = stored("cut", precision);
            let loaded = load_within(&path, None, 0).expect("a good store");
            assert!(loaded.is_intact() && loaded.require_intact().is_ok());
            cut(&path);
            assert!(!loaded.is_intact());
            let refusal = loaded.require_intact().expect_err("a file cut short").to_string();
            assert!(refusal.contains("cut short while in use"), "{refusal}");
            assert!(loaded.save(&path.with_extension("copy")).is_err() && !path.with_extension("copy").exists());
            // What contacts ask for is in memory; what is not is no number.
            let compliance = |green: &GreensFunction| green.symmetric_block(&[3, 5], &patch(green), &[0.5, 0.5]);
            assert_eq!(compliance(&loaded), compliance(&green));
            assert!(moved(&loaded).iter().any(|u| u.is_nan()));
            assert!(loaded.entry(12, 3).is_nan() && !loaded.entry(15, 3).is_nan());
            remove_file(path).expect("the store");
        }
    }

    #[test]
    fn a_store_in_memory_does_not_need_its_file() {
        let (green, path) = stored("memory", Precision::F32);
        let loaded = load_within(&path, None, usize::MAX).expect("a good store");
        cut(&path);
        assert!(loaded.is_intact());
        assert_eq!(moved(&loaded), moved(&green));
        remove_file(path).expect("the store");
    }

    #[test]
    fn a_damaged_block_is_refused_however_it_is_held() {
        let (_, path) = stored("damaged", Precision::F64);
        let reader = Reader::open(&path).expect("a good header");
        let at = reader.start + reader.tensor("psi").expect("the operator").data_offsets.0 as u64 + 300;
        let file = OpenOptions::new().write(true).open(&path).expect("the store");
        file.write_all_at(&[0xff], at).expect("a file that can be written");
        for bound in [usize::MAX, 0] {
            let refusal = load_within(&path, None, bound).err().expect("a damaged store").to_string();
            assert!(refusal.contains("checksum of block 0 differs"), "{refusal}");
        }
        remove_file(path).expect("the store");
    }
}
