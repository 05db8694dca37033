//! Defaults derived from a store: elastic constants at its surface, and the radius of the default tool.

use std::path::Path;

use palpate_core::contact::{Moduli, PatchGeometry};
use palpate_core::green::GreensFunction;
use palpate_core::green::accuracy::require_right;
use palpate_core::{Error, Result};
use serde_json::Value;

/// Size of a tool that suits a body, over the body's longest side: 5 mm on a block of 8 cm, 12 mm, a thumb, on a liver.
const PART_OF_BODY: f64 = 1.0 / 16.0;
/// How closely the largest contact radius is found, over the radius asked for.
const RADIUS_STEP: f64 = 0.01;

/// Elastic constants at the surface, as far as the store has them: the two of a body of one material, or those of every
/// surface node. A store of several materials that does not say where they are has none.
///
/// # Errors
/// Constants of another number of nodes.
pub fn moduli_of_store(green: &GreensFunction) -> Result<Option<Moduli>> {
    let description: Value = serde_json::from_str(&green.description).unwrap_or_default();
    let materials: Vec<&Value> = description["materials"].as_object().into_iter().flat_map(|m| m.values()).collect();
    let constants = |values: &Value| Some([values.get(0)?.as_f64()?.to_bits(), values.get(1)?.as_f64()?.to_bits()]);
    let mut kinds: Vec<_> = materials.iter().filter_map(|values| constants(values)).collect();
    kinds.sort_unstable();
    kinds.dedup();
    let homogeneous = kinds.len() == 1;
    let known = match (&description["surface_moduli"], &materials[..]) {
        (Value::Null, [one]) => constants(one).map(|c| c.map(|bits| vec![f64::from_bits(bits)])),
        (Value::Null, _) => None,
        (listed, _) => {
            let numbers = |values: &Value| values.as_array()?.iter().map(Value::as_f64).collect::<Option<Vec<_>>>();
            listed.get(0).and_then(numbers).zip(listed.get(1).and_then(numbers)).map(|(e, nu)| [e, nu])
        }
    };
    let Some(known) = known else { return Ok(None) };
    let count = green.surface_count();
    let [youngs, poissons] = known.map(|values| if values.len() == 1 { vec![values[0]; count] } else { values });
    if youngs.len() != count || poissons.len() != count {
        let path = green.path.as_deref().unwrap_or(Path::new("store"));
        let reason = format!("is damaged (elastic constants at {} of {count} nodes); compute it again", youngs.len());
        return Err(Error::store(path, reason));
    }
    Ok(Some(Moduli::linear(youngs, poissons, homogeneous)))
}

/// Radius of a tool that suits a body, m: a sixteenth of its longest side.
pub fn default_tool_radius(green: &GreensFunction) -> f64 {
    let positions = &green.surface.positions;
    let Some(&first) = positions.first() else { return 0.0 };
    let (low, high) = positions.iter().fold((first, first), |(low, high), &p| (low.min(p), high.max(p)));
    PART_OF_BODY * (high - low).max_element()
}

/// Largest contact radius up to `limit`, m, that can be weighed everywhere on a body, to about a hundredth.
pub fn largest_contact_radius(green: &GreensFunction, limit: f64) -> f64 {
    let geometry = PatchGeometry::new(&green.surface);
    let accepted = |radius: f64| geometry.check_radius(green, radius).is_ok();
    let (mut low, mut high) = (0.0, limit);
    if accepted(high) {
        return high;
    }
    while high - low > RADIUS_STEP * limit {
        let middle = 0.5 * (low + high);
        if accepted(middle) { low = middle } else { high = middle }
    }
    low
}

/// Refuses a store in which touches may be wrong by more than a tenth.
///
/// # Errors
/// [`Error::Precision`], with what it may be wrong by.
pub fn require_precise(green: &GreensFunction, name: &str) -> Result<()> {
    require_right(&format!("forces on {name}"), green.accuracy.touch)
}
