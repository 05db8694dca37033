//! Files of series beside the body's store: safetensors, found by content key, replaced only by rename.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

use glam::DVec3;
use rayon::prelude::*;

use super::known::{Layout, Series, Side};
use super::places::SeriesPlan;
use crate::arrays_file::{ArraysFile, ArraysKind};
use crate::contact::local::{SERIES_FIELDS, StrainLaw};
use crate::green::Progress;
use crate::{Error, Result};

/// Version of the computation and of the file's layout; part of the key.
const VERSION: u32 = 10;
const KIND: ArraysKind = ArraysKind { format: "palpate-series", name: "file of series", version: VERSION };
/// Digits of the key in the name of a file.
const DIGITS: usize = 16;

/// Where the series of a body for tools of one radius is stored.
pub struct SeriesFile {
    path: PathBuf,
    key: String,
}

impl SeriesFile {
    /// The file beside the `store` of a body whose Green's function has `green_key`, for tools of `radius`, m.
    pub fn beside(store: &Path, green_key: &str, laws: &[StrainLaw], radius: f64) -> Self {
        let mut hash = blake3::Hasher::new();
        hash.update(format!("palpate series {VERSION} {green_key}").as_bytes());
        for law in laws {
            let (kind, first, second) = match *law {
                StrainLaw::Linear => (0u8, 0.0, 0.0),
                StrainLaw::NeoHookean => (1, 0.0, 0.0),
                StrainLaw::MooneyRivlin { share } => (2, share, 0.0),
                StrainLaw::Yeoh { quadratic, cubic } => (3, quadratic, cubic),
            };
            hash.update(&[kind]);
            hash.update(bytemuck::cast_slice(&[first, second]));
        }
        hash.update(&radius.to_le_bytes());
        let key = hash.finalize().to_hex().to_string();
        let path = store.with_extension(format!("{}.series.palpate", &key[..DIGITS]));
        Self { path, key }
    }

    /// Where it is.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Reads any file of series, of whatever body.
    ///
    /// # Errors
    /// [`Error::Store`] that says what is wrong, or the operating system's error.
    pub fn read(path: &Path) -> Result<Series> {
        let mut file = KIND.read(path)?;
        let broken = || Error::store(path, "is damaged: its arrays do not fit");
        series_of(&mut file).ok_or_else(broken)
    }

    /// The stored series, complete or not; `None` for a file that is missing, damaged or of another body.
    pub fn load(&self) -> Option<Series> {
        let mut file = KIND.read(&self.path).ok()?;
        if file.text("key") != self.key { None } else { series_of(&mut file) }
    }

    /// Computes what is not stored yet, those blocks first that are `near` a point, m, and stores every round of them if the file can
    /// be written. The result has the same bits for any order, and after any interruption.
    ///
    /// # Errors
    /// A body that is not held, or an interruption by `progress`, which is called with the known places and all of them.
    pub fn compute(
        &self,
        plan: &SeriesPlan,
        near: &(dyn Fn() -> Option<DVec3> + Sync),
        progress: Progress<'_>,
    ) -> Result<Series> {
        let mut series = self.resume(plan.layout());
        if series.is_complete() {
            return Ok(series);
        }
        let (done, all) = (AtomicUsize::new(series.done()), series.layout.places.len());
        let interrupted = |done: usize| if progress(done, all) { Ok(()) } else { Err(Error::Interrupted) };
        interrupted(series.done())?;
        let body = plan.factorize()?;
        while !series.is_complete() {
            let solve = |block: usize| {
                let fields = plan.solve(&body, block);
                let before = done.fetch_add(fields.len(), Ordering::Relaxed);
                interrupted(before + fields.len()).map(|()| (block, fields))
            };
            let round = series.next(rayon::current_num_threads(), near());
            let found: Result<Vec<_>> = round.into_par_iter().map(solve).collect();
            found?.iter().for_each(|(block, fields)| series.set(*block, fields));
            // The result is the same if it cannot be written.
            drop(self.write(&series));
        }
        Ok(series)
    }

    /// What is stored of a series with such places; empty if that is nothing.
    pub fn resume(&self, layout: Layout) -> Series {
        let fitting = self.load().filter(|stored| stored.layout == layout);
        fitting.unwrap_or_else(|| Series::empty(layout))
    }

    /// Bytes of the file of a series with such places, without its header.
    pub fn size(layout: &Layout) -> usize {
        let Layout { sides, places, .. } = layout;
        let numbers = (SERIES_FIELDS + 1) * places.len() + 6 * sides.len() + layout.blocks() + 1;
        numbers * size_of::<f64>()
    }

    /// Writes a series, beside and then renamed.
    ///
    /// # Errors
    /// The operating system's.
    pub fn write(&self, series: &Series) -> Result<()> {
        let Series { layout, fields, known } = series;
        let sides: Vec<f64> =
            layout.sides.iter().flat_map(|side| [side.position.to_array(), side.normal.to_array()].concat()).collect();
        let places: Vec<f64> = layout.places.iter().map(|&fan| f64::from(fan)).collect();
        let known: Vec<f64> = known.iter().map(|&known| f64::from(u8::from(known))).collect();
        let arrays = [
            ("fields", vec![fields.len(), SERIES_FIELDS], fields.as_flattened()),
            ("known", vec![known.len()], &known[..]),
            ("places", vec![places.len()], &places[..]),
            ("sides", vec![layout.sides.len(), 6], &sides[..]),
            ("spacing", vec![1], &[layout.spacing]),
        ];
        KIND.write(&self.path, &[("key", &self.key)], &arrays)
    }
}

/// The series in a verified file; `None` for arrays that do not go together.
fn series_of(file: &mut ArraysFile) -> Option<Series> {
    let [fields, known, places, sides, spacing] =
        ["fields", "known", "places", "sides", "spacing"].map(|name| file.take(name).ok().map(|(_, numbers)| numbers));
    let (sides, places): (Vec<f64>, Vec<f64>) = (sides?, places?);
    let side =
        |[x, y, z, nx, ny, nz]: &[f64; 6]| Side { position: DVec3::new(*x, *y, *z), normal: DVec3::new(*nx, *ny, *nz) };
    let layout = Layout {
        sides: sides.as_chunks().0.iter().map(side).collect(),
        places: places.iter().map(|&fan| fan as u32).collect(),
        spacing: *spacing?.first()?,
    };
    let series = Series {
        fields: fields?.as_chunks().0.to_vec(),
        known: known?.iter().map(|&known| known > 0.0).collect(),
        layout,
    };
    let Series { layout, fields, known } = &series;
    let inside = layout.places.iter().all(|&fan| (fan as usize) < layout.sides.len());
    (inside && fields.len() == layout.places.len() && known.len() == layout.blocks()).then_some(series)
}
