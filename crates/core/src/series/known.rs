//! Coefficients at the places of a surface as far as they are known, and at its fans.

use glam::DVec3;
use rayon::prelude::*;

use crate::contact::SeriesFields;

/// Places that are solved together. The last bits of a solution depend on its neighbours in the block, so that a block is always
/// computed as a whole.
pub const BLOCK: usize = 8;
/// Cosine between normals of fans on one side of a body.
pub const SAME_SIDE: f64 = 0.5;
/// Distance up to which a place counts at a fan, over that of places.
const REACH: f64 = 2.0;

/// A smooth side of a surface node: its position, m, and outward normal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Side {
    /// m.
    pub position: DVec3,
    /// Unit vector.
    pub normal: DVec3,
}

/// Where the places of a series lie.
#[derive(Clone, Debug, PartialEq)]
pub struct Layout {
    /// The fans of the surface.
    pub sides: Vec<Side>,
    /// The fan of each place.
    pub places: Vec<u32>,
    /// Distance of places, m.
    pub spacing: f64,
}

/// The series of a body, as far as it is computed: block by block, each with its final bits.
#[derive(Clone, Debug, PartialEq)]
pub struct Series {
    /// Its places.
    pub layout: Layout,
    /// Coefficients at the places; zero where they are not known.
    pub fields: Vec<SeriesFields>,
    /// By block of places.
    pub known: Vec<bool>,
}

impl Layout {
    /// Number of blocks.
    pub fn blocks(&self) -> usize {
        self.places.len().div_ceil(BLOCK)
    }

    /// Hash of the places: blocks of the same places have the same numbers.
    pub fn order(&self) -> [u8; 32] {
        let mut hash = blake3::Hasher::new();
        for &place in &self.places {
            let Side { position, normal } = self.sides[place as usize];
            hash.update(bytemuck::cast_slice(&[position.to_array(), normal.to_array()]));
        }
        *hash.finalize().as_bytes()
    }

    /// Distance of a point from the nearest place of a block, m.
    fn distance(&self, block: usize, point: DVec3) -> f64 {
        let places = &self.places[BLOCK * block..self.places.len().min(BLOCK * (block + 1))];
        let distance = |&place: &u32| self.sides[place as usize].position.distance(point);
        places.iter().map(distance).fold(f64::INFINITY, f64::min)
    }
}

impl Series {
    /// Without any known place.
    pub fn empty(layout: Layout) -> Self {
        let (places, blocks) = (layout.places.len(), layout.blocks());
        Self { layout, fields: vec![SeriesFields::default(); places], known: vec![false; blocks] }
    }

    /// Whether all places are known.
    pub fn is_complete(&self) -> bool {
        self.known.iter().all(|&known| known)
    }

    /// How many places are known.
    pub fn done(&self) -> usize {
        let size = |block: usize| BLOCK.min(self.layout.places.len() - BLOCK * block);
        self.known.iter().enumerate().filter(|(_, known)| **known).map(|(block, _)| size(block)).sum()
    }

    /// Fields of a block.
    pub fn block(&self, block: usize) -> &[SeriesFields] {
        &self.fields[BLOCK * block..self.fields.len().min(BLOCK * (block + 1))]
    }

    /// Adds a block.
    pub fn set(&mut self, block: usize, fields: &[SeriesFields]) {
        self.fields[BLOCK * block..][..fields.len()].copy_from_slice(fields);
        self.known[block] = true;
    }

    /// The next `count` blocks: those nearest to a point, m, or the first ones.
    pub fn next(&self, count: usize, near: Option<DVec3>) -> Vec<usize> {
        let mut missing: Vec<usize> = (0..self.known.len()).filter(|&block| !self.known[block]).collect();
        if let Some(point) = near {
            missing.sort_by_cached_key(|&block| (self.layout.distance(block, point).to_bits(), block));
        }
        missing.truncate(count);
        missing
    }

    /// The same series with only some of its blocks, if it has them all.
    pub fn only(&self, known: &[bool]) -> Option<Self> {
        let has = known.len() == self.known.len() && known.iter().zip(&self.known).all(|(&asked, &has)| !asked || has);
        has.then(|| {
            let mut part = Self::empty(self.layout.clone());
            for block in (0..known.len()).filter(|&block| known[block]) {
                part.set(block, self.block(block));
            }
            part
        })
    }

    /// Coefficients at every fan: the mean of those at the places around it, weighted by distance. All are zero at a fan where there is
    /// no place, and as long as a place around it is not known: the coefficients of a fan change once, to their final bits.
    pub fn at_fans(&self) -> Vec<SeriesFields> {
        self.layout.sides.par_iter().map(|side| self.at(side)).collect()
    }

    fn at(&self, side: &Side) -> SeriesFields {
        let reach = REACH * self.layout.spacing;
        let (mut sum, mut weights) = (SeriesFields::default(), 0.0);
        for (rank, (&place, fields)) in self.layout.places.iter().zip(&self.fields).enumerate() {
            let other = &self.layout.sides[place as usize];
            let distance = side.position.distance(other.position) / reach;
            if distance >= 1.0 || other.normal.dot(side.normal) <= SAME_SIDE {
                continue;
            }
            if !self.known[rank / BLOCK] {
                return SeriesFields::default();
            }
            let weight = (1.0 - distance * distance).powi(2) / (distance * distance + 1e-4);
            weights += weight;
            sum.iter_mut().zip(fields).for_each(|(sum, field)| *sum += weight * field);
        }
        if weights > 0.0 { sum.map(|value| value / weights) } else { sum }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::local::SERIES_FIELDS;

    /// Places on a line, 1 m apart, with a fan at each and one between each pair; the fields are the place's coordinate.
    fn line(places: usize) -> Series {
        let side = |k: usize| Side { position: DVec3::X * (0.5 * k as f64), normal: DVec3::Z };
        let sides = (0..2 * places).map(side).collect();
        let layout = Layout { sides, places: (0..places as u32).map(|k| 2 * k).collect(), spacing: 1.0 };
        Series::empty(layout)
    }

    fn block(series: &Series, block: usize) -> Vec<SeriesFields> {
        let places = series.layout.places.len();
        (BLOCK * block..places.min(BLOCK * (block + 1))).map(|k| [1.0 + k as f64; SERIES_FIELDS]).collect()
    }

    #[test]
    fn blocks_near_a_point_come_first() {
        let mut series = line(3 * BLOCK + 2);
        let end = Some(DVec3::X * (3 * BLOCK + 2) as f64);
        assert_eq!((series.next(2, None), series.next(9, end)), (vec![0, 1], vec![3, 2, 1, 0]));
        series.set(3, &block(&series, 3));
        assert_eq!((series.done(), series.next(1, end)), (2, vec![2]));
    }

    /// A fan has zeros until all places around it are known, and then what the whole series has there.
    #[test]
    fn coefficients_of_a_fan_change_once_and_to_the_final_bits() {
        let mut whole = line(3 * BLOCK);
        (0..3).for_each(|k| whole.set(k, &block(&whole, k)));
        assert!(whole.is_complete());
        let last = whole.at_fans();
        for order in [[0, 1, 2], [2, 0, 1], [1, 2, 0]] {
            let (mut series, mut changed) = (line(3 * BLOCK), 0);
            for k in order {
                let before = series.at_fans();
                series.set(k, &block(&series, k));
                for ((before, now), last) in before.iter().zip(&series.at_fans()).zip(&last) {
                    assert!(now == before || (*before == SeriesFields::default() && now == last));
                    changed += usize::from(now != before);
                }
            }
            assert_eq!((&series, changed), (&whole, last.len()));
        }
        // Two places to each side of a border have some within reach that lie beyond.
        let mut first = line(3 * BLOCK);
        first.set(0, &block(&first, 0));
        let known = first.at_fans().iter().filter(|fields| **fields != SeriesFields::default()).count();
        assert_eq!(known, 2 * BLOCK - 3);
        assert_eq!(whole.only(&[true, false, false]), Some(first.clone()));
        assert_eq!(first.only(&[true, true, false]), None);
    }
}
