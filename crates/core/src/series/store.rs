//! Files of series beside the body's store: safetensors, found by content key, replaced only by rename.

use std::path::{Path, PathBuf};

use super::places::{Series, SeriesPlan, compute_series};
use crate::Result;
use crate::arrays_file::ArraysKind;
use crate::contact::local::{SERIES_FIELDS, StrainLaw};
use crate::green::{Problem, Progress};

/// Version of the computation and of the file's layout; part of the key.
const VERSION: u32 = 6;
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

    /// The stored series; `None` for a file that is missing, damaged or of another body.
    pub fn load(&self) -> Option<Series> {
        let mut file = KIND.read(&self.path).ok()?;
        let (fields, positions) = (file.take("fields").ok()?, file.take("positions").ok()?);
        let right = fields.0[1..] == [SERIES_FIELDS] && positions.0 == [fields.0[0], 3];
        let stored =
            || Series { fields: fields.1.as_chunks().0.to_vec(), positions: positions.1.as_chunks().0.to_vec() };
        (right && file.text("key") == self.key).then(stored)
    }

    /// Computes the series, and stores it if the file can be written.
    ///
    /// # Errors
    /// See [`compute_series`].
    pub fn compute(
        &self,
        problem: &Problem,
        laws: &[StrainLaw],
        radius: f64,
        progress: Progress<'_>,
    ) -> Result<Series> {
        let computed = compute_series(&SeriesPlan::new(problem, laws, radius)?, progress)?;
        let fans = computed.fields.len();
        let arrays = [
            ("fields", vec![fans, SERIES_FIELDS], computed.fields.as_flattened()),
            ("positions", vec![fans, 3], computed.positions.as_flattened()),
        ];
        // The result is the same if it cannot be written.
        drop(KIND.write(&self.path, &[("key", &self.key)], &arrays));
        Ok(computed)
    }
}
