//! `libpalpate`: the scene, the force loop and static answers for programs in C and C++.
//!
//! Objects are behind opaque handles. Every function returns a [`status::Status`]; what was wrong is a line of text for the
//! calling thread. No panic leaves the library. `include/palpate.h` is generated from these files by cbindgen
//! (`tests/header.rs`) and holds the rules for threads; docs/c-api.md is the guide.

pub mod abi;
pub mod arguments;
pub mod device;
pub mod force_loop;
pub mod frame;
pub mod library;
pub mod offline;
pub mod options;
pub mod scene;
pub mod settings;
pub mod statics;
pub mod status;
pub mod store;
pub mod tick;
pub mod versioned_struct;
