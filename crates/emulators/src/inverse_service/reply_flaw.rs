//! Flawed replies, for tests of the driver.

use std::time::Duration;

use serde_json::Value;
use tungstenite::Message;

/// What is wrong with the replies.
#[derive(Clone, Debug, PartialEq)]
pub enum ReplyFlaw {
    /// None comes.
    Silence,
    /// They come so much later.
    Late(Duration),
    /// Each comes twice.
    Twice,
    /// The connection is cut instead.
    Cut,
    /// They end in the middle.
    Truncated,
    /// This text instead.
    Text(String),
    /// Bytes instead of text.
    Binary,
    /// They are followed by so many spaces, bytes.
    Huge(usize),
    /// The value at this path, as `/inverse3/0/state`, is another one.
    Replaced(&'static str, Value),
    /// What is at this path is missing.
    Missing(&'static str),
}

impl ReplyFlaw {
    /// What is sent instead of a reply.
    pub fn apply(&self, mut reply: Value) -> Vec<Message> {
        match self {
            ReplyFlaw::Silence | ReplyFlaw::Cut => Vec::new(),
            ReplyFlaw::Late(_) => vec![Message::text(reply.to_string())],
            ReplyFlaw::Twice => vec![Message::text(reply.to_string()); 2],
            ReplyFlaw::Truncated => {
                let mut text = reply.to_string();
                text.truncate(text.len() * 2 / 3);
                vec![Message::text(text)]
            }
            ReplyFlaw::Text(text) => vec![Message::text(text.clone())],
            ReplyFlaw::Binary => vec![Message::binary(reply.to_string().into_bytes())],
            ReplyFlaw::Huge(bytes) => vec![Message::text(reply.to_string() + &" ".repeat(*bytes))],
            ReplyFlaw::Replaced(path, value) => {
                if let Some(there) = reply.pointer_mut(path) {
                    *there = value.clone();
                }
                vec![Message::text(reply.to_string())]
            }
            ReplyFlaw::Missing(path) => {
                if let Some((parent, key)) = path.rsplit_once('/') {
                    match reply.pointer_mut(parent) {
                        Some(Value::Object(parent)) => drop(parent.remove(key)),
                        Some(Value::Array(parent)) => parent.clear(),
                        _ => {}
                    }
                }
                vec![Message::text(reply.to_string())]
            }
        }
    }

    /// How much later a reply comes.
    pub fn delay(&self) -> Duration {
        if let ReplyFlaw::Late(time) = self { *time } else { Duration::ZERO }
    }
}
