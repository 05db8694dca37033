//! The part of a store that contacts and pictures read, as few bytes: for a page that fetches it.
//!
//! Left out are supported dofs, which neither take a force nor move, and one half of the touchable square, which is symmetric
//! to the bit. 16-bit numbers are written as differences from the column before of the same axis, whose node is a neighbour in
//! space, and all numbers by planes of bytes: what a general compressor makes small. The numbers themselves are those of the
//! store, so that forces are the same to the bit.

use safetensors::tensor::{Dtype, SafeTensors};

use super::entries::Entries;
use super::function::GreensFunction;
use super::numbers::Numbers;
use super::precision::Precision;
use super::store_writer::header_of;
use crate::Result;

/// The block that stands for the operator.
pub(super) const BLOCK: &str = "packed";
/// Its checksum among the header's texts.
pub(super) const SUM: &str = "packed_checksum";

impl GreensFunction {
    /// A store of what contacts and pictures read, as bytes that [`GreensFunction::load`] reads. Every number is that of this
    /// store.
    ///
    /// # Errors
    /// A file that was cut short while in use.
    pub fn packed(&self) -> Result<Vec<u8>> {
        self.require_intact()?;
        let block = self.entries.packed();
        let small = self.small_tensors();
        let mut header = header_of(self, self.precision());
        header.text(SUM, blake3::hash(&block).to_hex().as_str());
        header.tensor(BLOCK, Dtype::U8, &[block.len()], block.len());
        for (name, dtype, shape, data) in &small {
            header.tensor(name, *dtype, shape, data.len());
        }
        let mut bytes = header.bytes();
        bytes.extend(block);
        small.iter().for_each(|(_, _, _, data)| bytes.extend(data));
        debug_assert!(SafeTensors::deserialize(&bytes).is_ok());
        Ok(bytes)
    }
}

/// Places of the numbers in the columns in memory: rows of column after column.
struct Layout {
    /// Stored rows and columns of the touchable square that are free.
    square: Vec<usize>,
    /// Free rows below it.
    below: Vec<usize>,
}

impl Layout {
    fn of(entries: &Entries) -> Self {
        let dofs = (0..entries.free.len()).flat_map(|place| (0..3).map(move |axis| (place, axis)));
        let free = dofs.filter(|&(place, axis)| entries.free[place][axis] != 0.0).map(|(place, axis)| 3 * place + axis);
        let end = 3 * entries.node_order.touchable_count();
        let (square, below) = free.partition(|&row| row < end);
        Self { square, below }
    }

    fn count(&self) -> usize {
        let n = self.square.len();
        n * (n + 1) / 2 + n * self.below.len()
    }

    /// Hands out rank of the column among the free ones and stored row of each number, in the order of the file.
    fn each(&self, mut visit: impl FnMut(usize, usize)) {
        for rank in 0..self.square.len() {
            for &row in self.square[..=rank].iter().chain(&self.below) {
                visit(rank, row);
            }
        }
    }
}

/// Columns between two of the same axis.
const AXES: usize = 3;

impl Entries {
    fn packed(&self) -> Vec<u8> {
        let layout = Layout::of(self);
        let width = self.precision().bytes();
        let mut planes = vec![0; layout.count() * width];
        let mut at = 0;
        let count = layout.count();
        layout.each(|rank, row| {
            let mut word = self.stored_word(row, layout.square[rank]);
            if width == 2 {
                let before = self.predicted(&layout, rank, row, |row, column| self.stored_word(row, column));
                word = word.wrapping_sub(before) & 0xffff;
                // Small differences of either sign have a small first byte.
                word = zigzag(word as u16).into();
            }
            for plane in 0..width {
                planes[plane * count + at] = (word >> (8 * plane)) as u8;
            }
            at += 1;
        });
        planes
    }

    fn predicted(&self, layout: &Layout, rank: usize, row: usize, word: impl Fn(usize, usize) -> u64) -> u64 {
        match rank.checked_sub(AXES) {
            // Above the diagonal of that column, or below the square: read before.
            Some(before) if row <= layout.square[before] || row >= 3 * self.node_order.touchable_count() => {
                word(row, layout.square[before])
            }
            _ => 0,
        }
    }

    /// Bits of a stored number.
    fn stored_word(&self, row: usize, column: usize) -> u64 {
        if row >= self.resident {
            return self.word_from_file(row, column);
        }
        let at = column * self.resident + row;
        match &self.numbers {
            Numbers::F16(numbers) => u64::from(numbers[at] as u16),
            Numbers::F32(numbers) => u64::from(numbers[at].to_bits()),
            Numbers::F64(numbers) => numbers[at].to_bits(),
        }
    }

    fn word_from_file(&self, row: usize, column: usize) -> u64 {
        let width = self.precision().bytes();
        let mut bytes = [0; 8];
        let read = self.file.as_ref().is_some_and(|file| file.read(column, row * width, &mut bytes[..width]).is_ok());
        if read { u64::from_le_bytes(bytes) } else { u64::MAX }
    }

    /// Fills the columns in memory, of which nothing is known yet, from a packed block; `None` for one of another length.
    pub(super) fn unpack(&mut self, planes: &[u8]) -> Option<()> {
        let layout = Layout::of(self);
        let (count, width, resident) = (layout.count(), self.precision().bytes(), self.resident);
        if planes.len() != count * width {
            return None;
        }
        let square_end = 3 * self.node_order.touchable_count();
        let mut numbers = std::mem::replace(&mut self.numbers, Numbers::zeros(Precision::F16, 0));
        let mut at = 0;
        layout.each(|rank, row| {
            let mut word = 0;
            for plane in 0..width {
                word |= u64::from(planes[plane * count + at]) << (8 * plane);
            }
            at += 1;
            let column = layout.square[rank];
            let mut places = [(row, column), (row, column)];
            if row < square_end {
                places[1] = (column, row);
            }
            let before = if width == 2 {
                self.predicted(&layout, rank, row, |row, column| match &numbers {
                    Numbers::F16(numbers) => u64::from(numbers[column * resident + row] as u16),
                    _ => 0,
                })
            } else {
                0
            };
            for (row, column) in places {
                let at = column * resident + row;
                match &mut numbers {
                    Numbers::F16(numbers) => numbers[at] = unzigzag(word as u16).wrapping_add(before as u16) as i16,
                    Numbers::F32(numbers) => numbers[at] = f32::from_bits(word as u32),
                    Numbers::F64(numbers) => numbers[at] = f64::from_bits(word),
                }
            }
        });
        self.numbers = numbers;
        Some(())
    }
}

fn zigzag(difference: u16) -> u16 {
    (difference << 1) ^ (((difference as i16) >> 15) as u16)
}

fn unzigzag(word: u16) -> u16 {
    (word >> 1) ^ (word & 1).wrapping_neg()
}
