//! Replies that a service should not give.

use std::time::Duration;

use serde_json::Value;
use tungstenite::Message;

/// What is wrong with the replies.
#[derive(Clone, Debug, PartialEq)]
pub enum Trouble {
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

impl Trouble {
    /// What is sent instead of a reply.
    pub fn spoil(&self, mut reply: Value) -> Vec<Message> {
        match self {
            Trouble::Silence | Trouble::Cut => Vec::new(),
            Trouble::Late(_) => vec![Message::text(reply.to_string())],
            Trouble::Twice => vec![Message::text(reply.to_string()); 2],
            Trouble::Truncated => {
                let mut text = reply.to_string();
                text.truncate(text.len() * 2 / 3);
                vec![Message::text(text)]
            }
            Trouble::Text(text) => vec![Message::text(text.clone())],
            Trouble::Binary => vec![Message::binary(reply.to_string().into_bytes())],
            Trouble::Huge(bytes) => vec![Message::text(reply.to_string() + &" ".repeat(*bytes))],
            Trouble::Replaced(path, value) => {
                if let Some(there) = reply.pointer_mut(path) {
                    *there = value.clone();
                }
                vec![Message::text(reply.to_string())]
            }
            Trouble::Missing(path) => {
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
        if let Trouble::Late(time) = self { *time } else { Duration::ZERO }
    }
}
