//! The header in the repository is the one generated from the sources.

use std::fs;
use std::path::{Path, PathBuf};

const ADVICE: &str = "run: cargo test -p palpate-capi --test header -- --ignored";

fn header() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("include/palpate.h")
}

fn generated() -> String {
    let crate_folder = Path::new(env!("CARGO_MANIFEST_DIR"));
    let config = cbindgen::Config::from_file(crate_folder.join("cbindgen.toml")).expect("a valid cbindgen.toml");
    // In the order in which a program meets them.
    let files = [
        "abi",
        "status",
        "library",
        "store",
        "statics",
        "options",
        "scene",
        "offline",
        "force_loop",
        "tick",
        "frame",
        "settings",
    ];
    let sources = files.map(|name| crate_folder.join(format!("src/{name}.rs")));
    let builder = sources.iter().fold(cbindgen::Builder::new().with_config(config), |b, source| b.with_src(source));
    let mut text = Vec::new();
    builder.generate().expect("sources that cbindgen reads").write(&mut text);
    String::from_utf8(text).expect("text")
}

#[test]
fn the_header_is_current() {
    let header_text = fs::read_to_string(header()).unwrap_or_default();
    assert!(header_text == generated(), "include/palpate.h is not what the sources say; {ADVICE}");
}

/// Every exported function is in the header: a file that is missing in the list above would leave its functions out.
#[test]
fn every_exported_function_is_in_the_header() {
    let text = generated();
    let mut count = 0;
    for entry in fs::read_dir(Path::new(env!("CARGO_MANIFEST_DIR")).join("src")).expect("sources") {
        let source = fs::read_to_string(entry.expect("a source").path()).expect("text");
        for line in source.lines().filter(|line| line.contains("extern \"C\" fn ")) {
            let name = line.split("fn ").nth(1).and_then(|rest| rest.split('(').next()).expect("a name");
            assert!(text.contains(&format!("{name}(")), "{name} is not in the header");
            count += 1;
        }
    }
    assert!(count > 30);
}

#[test]
#[ignore = "writes include/palpate.h"]
fn write_the_header() {
    fs::write(header(), generated()).expect("a writable folder");
}
