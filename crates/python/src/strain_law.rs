//! Laws of materials beyond small strain, from Python.

use palpate_core::contact::local::StrainLaw;
use pyo3::prelude::*;

/// A law by its name and two ratios of its constants.
pub fn strain_law(name: &str, first: f64, second: f64) -> Option<StrainLaw> {
    Some(match name {
        "linear" => StrainLaw::Linear,
        "neo-hookean" => StrainLaw::NeoHookean,
        "mooney-rivlin" => StrainLaw::MooneyRivlin { share: first },
        "yeoh" => StrainLaw::Yeoh { quadratic: first, cubic: second },
        _ => return None,
    })
}

/// Coefficients of a sphere's contact at finite strain of a material, by its law, two ratios of its constants and Poisson's ratio;
/// `None` outside of the table.
#[pyfunction]
pub fn strain_terms(law: &str, first: f64, second: f64, poisson: f64) -> Option<[f64; 3]> {
    let law = strain_law(law, first, second)?;
    law.is_known(poisson).then(|| palpate_core::contact::local::strain_terms(&law, poisson))
}
