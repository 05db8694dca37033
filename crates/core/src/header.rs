//! The head of a safetensors file (the header's length and its JSON) under a checksum that stands in the header itself.
//!
//! Blocks have checksums of their own. What else an answer depends on (elastic constants, names, shapes and places of the
//! blocks) is in the header, and a changed digit there would load. The sum is that of all bytes of the head, with zeros in
//! place of the sum.

use safetensors::tensor::Dtype;

/// Name of the sum among the header's texts.
const NAME: &str = "header_checksum";
/// Digits of the sum (BLAKE3, hexadecimal).
const DIGITS: usize = 64;
/// Longest header that is read, bytes; safetensors allows no longer one.
pub(crate) const HEADER_BYTES: u64 = 100_000_000;

/// The header of a safetensors file: its length in eight bytes, then JSON, padded so that what follows is aligned.
pub(crate) struct Header {
    fields: serde_json::Map<String, serde_json::Value>,
    end: usize,
}

impl Header {
    /// With these texts.
    pub fn new<'a>(texts: impl IntoIterator<Item = (&'a str, String)>) -> Self {
        let mut header = Self { fields: serde_json::Map::new(), end: 0 };
        texts.into_iter().for_each(|(name, text)| header.text(name, &text));
        // In place of the sum.
        header.text(NAME, &"0".repeat(DIGITS));
        header
    }

    /// Adds a text.
    pub fn text(&mut self, name: &str, text: &str) {
        let texts = self.fields.entry("__metadata__").or_insert_with(|| serde_json::json!({}));
        texts[name] = text.into();
    }

    /// Adds a tensor behind the others.
    pub fn tensor(&mut self, name: &str, dtype: Dtype, shape: &[usize], bytes: usize) {
        let offsets = [self.end, self.end + bytes];
        let tensor = serde_json::json!({"dtype": dtype.to_string(), "shape": shape, "data_offsets": offsets});
        self.fields.insert(name.to_string(), tensor);
        self.end += bytes;
    }

    /// The header, sealed.
    pub fn bytes(self) -> Vec<u8> {
        let mut json = serde_json::Value::Object(self.fields).to_string().into_bytes();
        json.resize(json.len().next_multiple_of(8), b' ');
        let mut head = [&(json.len() as u64).to_le_bytes()[..], &json].concat();
        let sealed = seal(&mut head);
        debug_assert!(sealed, "the header has a place for its sum");
        head
    }
}

/// Writes the sum into the head of a file: the length of the header in eight bytes, and the header. `false` where it has no
/// place for it.
fn seal(head: &mut [u8]) -> bool {
    let Some((at, sum)) = sum_of(head) else { return false };
    head[at..at + DIGITS].copy_from_slice(sum.as_bytes());
    true
}

/// Whether the head of a file is as it was sealed.
pub(crate) fn is_sealed(head: &[u8]) -> bool {
    sum_of(head).is_some_and(|(at, sum)| head[at..at + DIGITS] == *sum.as_bytes())
}

/// The head of a whole file in memory; `None` where it has none.
pub(crate) fn head_of(bytes: &[u8]) -> Option<&[u8]> {
    let length = u64::from_le_bytes(bytes.get(..8)?.try_into().ok()?);
    bytes.get(..usize::try_from(length).ok()?.checked_add(8)?)
}

/// Where the sum stands, and what it should be. A quoted name in another text has a backslash before its quotes.
fn sum_of(head: &[u8]) -> Option<(usize, String)> {
    let name = format!("\"{NAME}\":\"");
    let at = head.windows(name.len()).position(|window| window == name.as_bytes())? + name.len();
    let behind = head.get(at + DIGITS..)?;
    let mut hash = blake3::Hasher::new();
    hash.update(&head[..at]);
    hash.update(&[b'0'; DIGITS]);
    hash.update(behind);
    Some((at, hash.finalize().to_hex().to_string()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_other_byte_of_a_sealed_head_passes() {
        let json = format!(r#"{{"a":"\"header_checksum\":\"7","{NAME}":"{}","b":"10000"}} "#, "0".repeat(DIGITS));
        let mut head = [&(json.len() as u64).to_le_bytes()[..], json.as_bytes()].concat();
        assert!(!is_sealed(&head));
        assert!(seal(&mut head) && is_sealed(&head));
        assert_eq!(head_of(&[&head[..], b"blocks"].concat()), Some(&head[..]));
        for at in 0..head.len() {
            for change in [1, 8, 0x10, 0x80] {
                head[at] ^= change;
                assert!(!is_sealed(&head), "byte {at}");
                head[at] ^= change;
            }
        }
        assert!(!seal(&mut []) && head_of(b"short").is_none());
    }
}
