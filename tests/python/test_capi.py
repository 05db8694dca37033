"""The C interface: installed, found by pkg-config and CMake, its examples clean, its forces those of Python."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

import palpate
from palpate.scene import BuiltScene
from palpate.scene.series import with_series

ROOT = Path(__file__).resolve().parents[2]
WARNINGS = ["-Wall", "-Wextra", "-Wpedantic", "-Werror"]
# Reached by the presses of the tests.
STRAIN_LIMIT = 0.08
TOOLS = ("gcc", "g++", "cmake", "pkg-config", "valgrind", "cargo")

missing = [tool for tool in TOOLS if shutil.which(tool) is None]
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(bool(missing), reason=f"{', '.join(missing)}: not installed"),
]


def run(*command: object, timeout: float = 280, **environment: str) -> str:
    done = subprocess.run(
        [os.fspath(word) if isinstance(word, Path) else str(word) for word in command],
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        timeout=timeout,
    )
    assert done.returncode == 0, f"{command}: {done.stdout}{done.stderr}"
    return done.stdout + done.stderr


@pytest.fixture(scope="module")
def prefix(tmp_path_factory) -> Path:
    """Where the library is installed."""
    where = tmp_path_factory.mktemp("prefix")
    run(ROOT / "scripts/install_c.sh", where, built_libraries(ROOT))
    return where


def built_libraries(workspace: Path) -> Path:
    """Folder of the libraries of a workspace, which are built with the test of the header.

    Cargo then takes what it has compiled for the tests of all crates. Built by themselves the libraries would ask for
    fewer features of their dependencies; built with the extension, that would be compiled again, for another Python.
    """
    target = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target"))
    command = ("cargo", "test", "--release", "--quiet", "--manifest-path", workspace / "Cargo.toml")
    run(*command, "--workspace", "--test", "header", "--no-run", "--target-dir", target, timeout=900)
    return target / "release/deps"


@pytest.fixture(scope="module")
def scene(block, block_green) -> BuiltScene:
    """A block under a ball and a capsule that slide."""
    tools = [
        {"radius": 0.006, "contact_radius": 0.008, "contact": "local"},
        {"shape": "capsule", "radius": 0.005, "length": 0.01},
    ]
    view = {"strain_limit": STRAIN_LIMIT}
    read = palpate.Scene(body={"store": "of a test"}, tool=tools, device={"ramp": 0.05}, view=view)
    return BuiltScene.of(read, block, block_green)


@pytest.fixture(scope="module")
def packed(scene, tmp_path_factory) -> Path:
    where = tmp_path_factory.mktemp("packed") / "block.pack"
    palpate.pack(scene, where)
    return where


def flags(prefix: Path, *static: str) -> list[str]:
    return run(
        "pkg-config", "--cflags", "--libs", *static, "palpate", PKG_CONFIG_PATH=f"{prefix}/lib/pkgconfig"
    ).split()


def compiled(prefix: Path, source: Path, *options: str) -> Path:
    program = prefix / f"{source.stem}{len(options)}"
    if program.exists():
        return program
    standard = ["gcc", "-std=c99"] if source.suffix == ".c" else ["g++", "-std=c++17"]
    run(
        *standard,
        *WARNINGS,
        "-g",
        *options,
        source,
        "-o",
        program,
        *flags(prefix),
        f"-Wl,-rpath,{prefix}/lib",
        "-lm",
        "-pthread",
    )
    return program


def path_of(ticks: int, tools: int) -> np.ndarray:
    """Presses, deep enough for the limit of strain, and slides."""
    phase = np.linspace(0, 3 * np.pi, ticks)
    depth = 0.012 * np.abs(np.sin(phase)) - 0.001
    first = np.array([0.031, 0.026, 0.056]) + np.outer(depth, [0.3, 0.1, -1.0])
    second = np.array([0.060, 0.024, 0.055]) + np.outer(depth, [-0.2, 0.2, -0.6])
    return np.ascontiguousarray(np.stack([first, second], axis=1)[:, :tools])


def played(prefix: Path, scene: Path, positions: np.ndarray, folder: Path) -> np.ndarray:
    """Forces (2, ticks, tools, 3) of a program in C: of the script, and tick by tick."""
    program = compiled(prefix, ROOT / "tests/c/same_bits.c")
    (folder / "positions").write_bytes(positions.tobytes())
    run(program, scene, folder / "positions", positions.shape[1], folder / "forces")
    return np.fromfile(folder / "forces").reshape(2, *positions.shape)


def test_a_packed_scene_has_the_forces_of_python_to_the_bit(prefix, scene, packed, tmp_path):
    positions = path_of(700, 2)
    recording = palpate.Simulation(scene).play(positions)
    assert np.abs(recording.forces).max() > 0.3 and recording.limited.any()
    script, _ = played(prefix, packed, positions, tmp_path)
    assert np.array_equal(script, recording.forces)
    # When strain has been prepared beside a loop that ticks is not the same from run to run.
    tables = scene.scene.model_copy(update={"view": scene.scene.view.model_copy(update={"strain_limit": 0})})
    free = BuiltScene(tables, scene.bodies)
    palpate.pack(free, tmp_path / "free.pack")
    forces = palpate.Simulation(free).run(positions)
    script, ticks = played(prefix, tmp_path / "free.pack", positions, tmp_path)
    assert np.array_equal(script, forces) and np.array_equal(ticks, forces)
    assert np.abs(forces - recording.forces).max() > 0.01


def test_a_hyperelastic_body_too(prefix, block, block_green, tmp_path):
    material = palpate.Material(10e3, 0.4, law="neo-hookean")
    body = palpate.Body(block.mesh, material=material, fixed=block.fixed_nodes)
    table = {"model": "beam"}
    tables = palpate.Scene(body=table, tool={"radius": 0.006}, view={"strain_limit": 0}, device={"ramp": 0})
    built = with_series(BuiltScene.of(tables, body, block_green))
    assert built.bodies[0].series
    palpate.pack(built, tmp_path / "neo-hookean.pack")
    positions = path_of(400, 1)
    script, ticks = played(prefix, tmp_path / "neo-hookean.pack", positions, tmp_path)
    forces = palpate.Simulation(built).run(positions)
    assert np.array_equal(script, forces) and np.array_equal(ticks, forces)
    linear = palpate.Simulation(BuiltScene.of(tables, block, block_green)).run(positions)
    assert np.abs(forces - linear).max() > 1e-3 * np.abs(linear).max()


def test_a_body_in_motion_and_a_bare_store_too(prefix, block, block_green, tmp_path):
    positions = path_of(400, 1)
    table = {"model": "beam"}
    moving = palpate.Scene(
        body=table, dynamics={"modes": 12}, tool={"radius": 0.006}, view={"strain_limit": 0}, device={"ramp": 0}
    )
    motion = moving.dynamics.build(block, moving.device.max_stiffness, False)
    built = BuiltScene.of(moving, block, block_green, motion)
    palpate.pack(built, tmp_path / "moving.pack")
    script, ticks = played(prefix, tmp_path / "moving.pack", positions, tmp_path)
    forces = palpate.Simulation(built).run(positions)
    assert np.array_equal(script, forces) and np.array_equal(ticks, forces) and np.abs(forces).max() > 0.1
    store = tmp_path / "block.palpate"
    block_green.save(store)
    script, _ = played(prefix, store, positions, tmp_path)
    assert np.array_equal(script, palpate.Simulation(palpate.Scene.of_store(store)).run(positions))


def test_a_packed_scene_is_whole_or_refused(prefix, packed, tmp_path):
    program = compiled(prefix, ROOT / "examples/cpp/render_loop.cpp")
    copy = tmp_path / "copy.pack"
    for name, change, words in (
        ("scene.json", lambda data: data.replace(b'"version": ', b'"version": 9'), "version 9"),
        ("scene.json", lambda data: data.replace(b"body-0.palpate", b"../../b.palpate"), "outside of itself"),
        ("scene.json", lambda data: data.replace(b'"key": "', b'"key": "0'), "another body"),
        ("body-0.arrays.safetensors", lambda data: data[:-1] + bytes([data[-1] ^ 1]), "checksum differs"),
        ("body-0.palpate", lambda data: data[:-100], "cut short"),
    ):
        shutil.rmtree(copy, ignore_errors=True)
        shutil.copytree(packed, copy)
        file = copy / name
        data = file.read_bytes()
        changed = change(data)
        assert changed != data
        file.unlink()
        file.write_bytes(changed)
        done = subprocess.run([program, copy], cwd=tmp_path, capture_output=True, text=True, timeout=60)
        assert done.returncode == 2 and words in done.stderr and done.stderr.count("\n") == 1, done.stderr
    with pytest.raises(palpate.SceneError, match="something else"):
        palpate.pack(palpate.Scene.of_store(packed / "body-0.palpate"), tmp_path)


def test_touch_is_that_of_python(prefix, block_green, tmp_path):
    store = tmp_path / "block.palpate"
    block_green.save(store)
    program = compiled(prefix, ROOT / "examples/c/touch.c")
    result = run(program, store, "2")
    positions = block_green.surface_positions
    low, high, radius = positions.min(axis=0), positions.max(axis=0), block_green.extents.max() / 16
    top = [*(0.5 * (low + high))[:2], high[2]]
    answer = block_green.touch(top, (None, None, -0.002), radius)
    force = result.split("body: ")[1].split(" N")[0].split()
    assert np.array_equal(np.array(force, dtype=float), answer.force)
    refused = subprocess.run([program, tmp_path / "none.palpate"], capture_output=True, text=True)
    assert refused.returncode == 2 and "none.palpate" in refused.stderr


def test_examples_are_clean_under_the_sanitizers(prefix, packed, tmp_path):
    options = ["-fsanitize=address,undefined", "-fno-omit-frame-pointer"]
    touch = compiled(prefix, ROOT / "examples/c/touch.c", *options)
    loop = compiled(prefix, ROOT / "examples/cpp/render_loop.cpp", *options)
    strict = {"ASAN_OPTIONS": "detect_leaks=1", "UBSAN_OPTIONS": "halt_on_error=1"}
    run(touch, packed / "body-0.palpate", "1", **strict)
    table = tmp_path / "frames.csv"
    run(loop, packed, "--seconds", "1.1", "--rate", "500", "--out", table, **strict)
    rows = np.genfromtxt(table, delimiter=",", names=True)
    assert len(rows) == 66 and rows["force_z_N"].max() > 0.1 and rows["largest_displacement_m"].max() > 1e-4


def test_examples_are_clean_under_valgrind(prefix, packed, tmp_path):
    kinds = "leak-kinds=definite,indirect"
    watch = [
        "valgrind",
        "--quiet",
        "--leak-check=full",
        f"--errors-for-{kinds}",
        f"--show-{kinds}",
        "--error-exitcode=9",
    ]
    touch = compiled(prefix, ROOT / "examples/c/touch.c")
    # One thread at a time runs: those of a pool would only wait for each other.
    alone = {"RAYON_NUM_THREADS": "1"}
    run(*watch, touch, packed / "body-0.palpate", "1", **alone)
    loop = compiled(prefix, ROOT / "examples/cpp/render_loop.cpp")
    words = ["--seconds", "1.5", "--rate", "20", "--out", tmp_path / "frames.csv"]
    done = subprocess.run([*watch, loop, packed, *words], env={**os.environ, **alone}, capture_output=True, text=True)
    # Ticks may take so long there that no force is let out, which ends in 1.
    assert done.returncode in (0, 1), done.stderr
    assert "==" not in done.stderr, done.stderr


def test_cmake_finds_it_and_its_static_form_links(prefix, tmp_path):
    options = [
        f"-DCMAKE_PREFIX_PATH={prefix}",
        f"-DCMAKE_C_FLAGS={' '.join(WARNINGS)}",
        f"-DCMAKE_CXX_FLAGS={' '.join(WARNINGS)}",
    ]
    run("cmake", "-S", ROOT / "examples/c", "-B", tmp_path / "build", *options)
    run("cmake", "--build", tmp_path / "build")
    assert (tmp_path / "build/touch").exists() and (tmp_path / "build/render_loop").exists()
    # By the name that programs look for.
    assert "libpalpate.so.1" in run("readelf", "-d", tmp_path / "build/touch")
    static = tmp_path / "static"
    libs = [f"{prefix}/lib/libpalpate.a" if flag == "-lpalpate" else flag for flag in flags(prefix, "--static")]
    run("gcc", "-std=c99", ROOT / "examples/c/touch.c", "-o", static, *libs)
    assert subprocess.run([static], capture_output=True).returncode == 2


# Where a struct gets its first values: a member that has been added begins with its own.
FILLED = re.compile(r"(struct_size: size_of::<Self>\(\) as u32,|\.\.versioned_struct::zeroed\(\))")
BARE = "  Self { ..versioned_struct::zeroed() }"


def grown_library(folder: Path) -> Path:
    """Folder of a library whose structs that may grow have one more member at their ends, as a later version has."""
    # A workspace of the same members: cargo then takes what it has compiled for this one.
    copy = folder / "grown"
    crates = copy / "crates"
    crates.mkdir(parents=True)
    for crate in (ROOT / "crates").iterdir():
        if crate.name != "capi":
            (crates / crate.name).symlink_to(crate)
    shutil.copytree(ROOT / "crates/capi", crates / "capi", ignore=shutil.ignore_patterns("tests", "examples"))
    (crates / "capi/tests").mkdir()
    (crates / "capi/tests/header.rs").write_text("//! Tests nothing: cargo builds the library with it.\n")
    for name in ("Cargo.toml", "Cargo.lock"):
        shutil.copy(ROOT / name, copy)
    # By another name, for it is built beside the other one.
    manifest = (crates / "capi/Cargo.toml").read_text().replace('name = "palpate"', 'name = "palpate_grown"')
    (crates / "capi/Cargo.toml").write_text(manifest.replace('["cdylib", "staticlib", "lib"]', '["cdylib", "lib"]'))
    grown = []
    for source in (crates / "capi/src").glob("*.rs"):
        text = source.read_text()
        for name in re.findall(r"unsafe impl VersionedStruct for (\w+)", text.split("#[cfg(test)]")[0]):
            whole, added = rf"(pub struct {name} {{.*?)\n}}", r"\1\n    pub added: [f64; 3],\n}"
            text, count = re.subn(whole, added, text, count=1, flags=re.S)
            at = text.index(f"struct {name}")
            end = text.find("pub struct ", at)
            own, filled = FILLED.subn(
                r"added: [7.0; 3], \1", text[at:end].replace("  versioned_struct::zeroed()", BARE), count=1
            )
            assert filled == 1, name
            text = text[:at] + own + text[end:]
            grown += [name] * count
        source.write_text(text.replace("//!", "#![allow(missing_docs)]\n//!", 1) if source.name == "lib.rs" else text)
    assert len(grown) == 6
    libraries = built_libraries(copy)
    (folder / "lib").mkdir()
    shutil.copy(libraries / "libpalpate_grown.so", folder / "lib/libpalpate.so.1")
    return folder / "lib"


@pytest.mark.timeout(1000)
def test_programs_of_the_first_header_run_with_a_library_whose_structs_have_grown(prefix, block_green, tmp_path):
    store, program = tmp_path / "block.palpate", tmp_path / "sizes"
    block_green.save(store)
    frozen = ["-I", ROOT / "tests/c/abi-1.0", ROOT / "tests/c/sizes.c"]
    link = ["-L", prefix / "lib", "-lpalpate", "-lm"]
    run("gcc", "-std=c99", *WARNINGS, *frozen, "-o", program, *link)
    result = {
        where: run(program, store, LD_LIBRARY_PATH=str(where)) for where in (prefix / "lib", grown_library(tmp_path))
    }
    own, grown = result.values()
    assert own == grown and float(own.split()[2]) > 0.05, result
