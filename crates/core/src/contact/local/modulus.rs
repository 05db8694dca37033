//! Effective modulus of two elastic bodies that touch.

/// Poisson's ratio of a finger pad: soft tissue keeps its volume.
const PAD_POISSONS_RATIO: f64 = 0.5;

/// Effective modulus `E*` of the contact, Pa: `1/E* = (1 - nu^2)/E + (1 - nu_pad^2)/E_pad` (Hertz; Johnson, Contact
/// Mechanics, 1985, eq. 3.32), the last term with the Young's modulus of a finger pad that keeps its volume; a rigid tool
/// has none.
pub fn effective_modulus(youngs_modulus: f64, poissons_ratio: f64, pad_youngs_modulus: Option<f64>) -> f64 {
    let body = (1.0 - poissons_ratio * poissons_ratio) / youngs_modulus;
    let pad = pad_youngs_modulus.map_or(0.0, |e| (1.0 - PAD_POISSONS_RATIO * PAD_POISSONS_RATIO) / e);
    1.0 / (body + pad)
}

#[cfg(test)]
mod tests {
    use super::effective_modulus;

    #[test]
    fn a_pad_is_a_second_spring_in_series() {
        let rigid = effective_modulus(10e3, 0.45, None);
        assert!((rigid - 10e3 / (1.0 - 0.45 * 0.45)).abs() < 1e-9);
        // Body and pad of the same incompressible material: half of one alone.
        let soft = effective_modulus(10e3, 0.5, Some(10e3));
        assert!((soft - 0.5 * effective_modulus(10e3, 0.5, None)).abs() < 1e-9);
        // A pad as hard as steel is rigid.
        assert!((effective_modulus(10e3, 0.45, Some(2e11)) / rigid - 1.0).abs() < 1e-6);
    }
}
