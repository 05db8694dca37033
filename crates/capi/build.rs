//! The name that programs look for at run time carries the major number of the ABI.

fn main() {
    println!("cargo:rerun-if-changed=src/abi.rs");
    let source = include_str!("src/abi.rs");
    let line = source.lines().find(|line| line.contains("PALPATE_ABI_MAJOR")).unwrap_or_default();
    let major: String = line.chars().skip_while(|c| *c != '=').filter(char::is_ascii_digit).collect();
    assert!(!major.is_empty(), "src/abi.rs states no PALPATE_ABI_MAJOR");
    println!("cargo:rustc-cdylib-link-arg=-Wl,-soname,libpalpate.so.{major}");
}
