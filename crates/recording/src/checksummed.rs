//! Metadata of a recording with a checksum.
//!
//! MCAP sums up its chunks of messages, not the metadata beside them. These say which scene was recorded, and at which rate:
//! what a replay begins from.

use std::collections::BTreeMap;

/// Name of the sum among the texts.
const SUM: &str = "checksum";

/// Adds the sum of all texts.
pub(crate) fn with_checksum(mut texts: BTreeMap<String, String>) -> BTreeMap<String, String> {
    let sum = sum(&texts);
    texts.insert(SUM.into(), sum);
    texts
}

/// The texts without their sum.
///
/// # Errors
/// Texts that are not as they were written.
pub(crate) fn verified(mut texts: BTreeMap<String, String>) -> Result<BTreeMap<String, String>, String> {
    match texts.remove(SUM) {
        Some(written) if written == sum(&texts) => Ok(texts),
        _ => Err("the checksum of what was recorded differs".into()),
    }
}

/// Sum of the names and texts in their order.
fn sum(texts: &BTreeMap<String, String>) -> String {
    let mut hash = blake3::Hasher::new();
    for text in texts.iter().flat_map(|(name, text)| [name, text]) {
        hash.update(&(text.len() as u64).to_le_bytes());
        hash.update(text.as_bytes());
    }
    hash.finalize().to_hex().to_string()
}
