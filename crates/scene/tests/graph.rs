//! Bodies and tools by their handles, and what a bare store says of itself.

use std::path::PathBuf;
use std::sync::Arc;

use palpate_core::green::{GreensFunction, Precision, precompute};
use palpate_core::simulation::{LawKind, MAX_BODIES, Placement};
use palpate_core::strain::StrainMeasure;
use palpate_devices::DeviceLimits;
use palpate_scene::{Body, Scene, Tool, largest_contact_radius, moduli_of_store};

#[path = "../../core/tests/common/mod.rs"]
mod bodies;

/// A cube 0.1 m wide, as a store with a description.
fn green(description: &str) -> GreensFunction {
    let mut green = precompute(&bodies::cube(3), Precision::F32, &|_, _| true).expect("a solvable cube");
    green.description = description.into();
    green
}

fn body(description: &str) -> Body {
    Body::of_store(Arc::new(green(description))).expect("a body")
}

fn rubbing(friction: f64) -> Tool {
    Tool { settings: [("friction".into(), friction)].into(), ..Tool::default() }
}

const ONE: &str = r#"{"materials": {"all": [12345.678901234567, 0.45, 1000.0]}}"#;

#[test]
fn handles_are_never_given_again_and_ranks_follow_the_order() {
    let (mut scene, soft) = (Scene::default(), body(ONE));
    let first = scene.add_body(soft.clone()).expect("room");
    let second = scene.add_body(soft.clone()).expect("room");
    assert!(scene.remove_body(first).is_some() && scene.remove_body(first).is_none());
    let third = scene.add_body(soft.clone()).expect("room");
    assert_eq!(scene.bodies().map(|(id, _)| id).collect::<Vec<_>>(), [second, third]);
    assert!(third != first && !scene.place_body(first, Placement::default()));
    let tool = scene.add_tool(Tool::default()).expect("room");
    assert!(scene.set_device(tool, DeviceLimits::UNLIMITED));
    let prepared = scene.prepare().expect("a scene");
    assert_eq!((prepared.rank_of_body(second), prepared.rank_of_body(first)), (Some(0), None));
    for _ in 2..MAX_BODIES {
        scene.add_body(soft.clone()).expect("room");
    }
    let error = scene.add_body(soft).err().map(|error| error.to_string());
    assert_eq!(error.as_deref(), Some("a scene takes at most 4 bodies"));
    assert!(Scene::default().prepare().is_err(), "nothing to touch");
}

#[test]
fn a_change_keeps_bodies_tools_and_what_was_set_of_them() {
    let mut scene = Scene::default();
    let [first, second] = [(), ()].map(|()| scene.add_body(body(ONE)).expect("room"));
    let old = scene.add_tool(rubbing(0.1)).expect("room");
    let before = scene.prepare().expect("a scene");
    let mut settings = before.settings;
    (settings.friction[0], settings.stiffness_scale[1]) = (0.7, 2.0);
    scene.remove_body(first).expect("a body");
    scene.add_tool(rubbing(0.2)).expect("room");
    let moved = Placement { position: glam::DVec3::X, ..Placement::default() };
    assert!(scene.place_body(second, moved));
    let mut next = before.clone();
    next.settings = settings;
    let (changed, previous_ranks) = scene.prepare_change(&before).expect("a scene");
    next.continue_with(changed, previous_ranks, None, Vec::new()).expect("no loop");
    assert!(next.model.bodies[0].is_same(&before.model.bodies[1]) && next.model.bodies[0].placement == moved);
    assert_eq!(
        (previous_ranks.bodies[0], previous_ranks.tools[0], previous_ranks.tools[1]),
        (Some(1), before.rank_of_tool(old), None)
    );
    let now = next.settings;
    assert_eq!((now.friction[..2].to_vec(), now.stiffness_scale[0]), (vec![0.7, 0.2], 2.0));
    // What is not looked at in a tick changes without another model.
    scene.set_strain_measure(second, Arc::new(StrainMeasure::of_surface(&green(ONE).surface)));
    let (same, _) = scene.prepare_change(&next).expect("a scene");
    assert!(Arc::ptr_eq(&same.model, &next.model));
    // Another store of the same surface makes the body anew, one of another surface is refused.
    assert!(scene.replace_body(second, body(ONE)).is_ok());
    let (other, _) = scene.prepare_change(&next).expect("a scene");
    assert!(!other.model.bodies[0].is_same(&next.model.bodies[0]));
    let (mut surface, known) = (green(ONE), scene.bodies().count());
    surface.surface_nodes[0] += 1;
    let foreign = Body { green: Arc::new(surface), ..body(ONE) };
    let refused = scene.replace_body(second, foreign).err().map(|error| error.to_string());
    assert!(refused.is_some_and(|why| why.contains("its surface differs")) && scene.bodies().count() == known);
}

#[test]
fn a_tool_is_rendered_as_soft_as_its_device_needs_only_if_it_may() {
    let mut scene = Scene::default();
    scene.add_body(body(ONE)).expect("room");
    let device = DeviceLimits { max_stiffness: 400.0, ..DeviceLimits::UNLIMITED };
    for softened in [true, false] {
        scene.add_tool(Tool { device, softened, ..Tool::default() }).expect("room");
    }
    let prepared = scene.prepare().expect("a scene");
    assert_eq!([0, 1].map(|tool| prepared.model.tools[tool].max_stiffness), [400.0, 5000.0]);
    let unknown = Tool { settings: [("colour".into(), 1.0)].into(), ..Tool::default() };
    scene.add_tool(unknown).expect("room");
    let refused = scene.prepare().err().map(|error| error.to_string());
    assert_eq!(refused.as_deref(), Some("there is no setting 'colour'"));
}

#[test]
fn a_store_says_what_its_surface_is_made_of_to_the_bit() {
    let count = green("").surface_count();
    let of = |description: &str| moduli_of_store(&green(description));
    let one = of(ONE).expect("no damage").expect("constants");
    assert_eq!(
        (one.youngs[count - 1].to_bits(), one.poissons[0], one.homogeneous),
        (12345.678901234567_f64.to_bits(), 0.45, true)
    );
    // Two materials of which an older store does not say where they are.
    let two = r#"{"materials": {"a": [1e4, 0.4, 1e3], "b": [2e4, 0.4, 1e3]}}"#;
    assert!(of(two).expect("no damage").is_none());
    assert!(of("").expect("no damage").is_none());
    let even = two.replacen('{', r#"{"surface_moduli": [[1e4], [0.4]], "#, 1);
    let even = of(&even).expect("no damage").expect("constants");
    assert!(even.youngs == vec![1e4; count] && !even.homogeneous);
    let short = two.replacen('{', r#"{"surface_moduli": [[1e4, 2e4], [0.4, 0.4]], "#, 1);
    assert!(of(&short).is_err_and(|error| error.to_string().contains("constants at 2 of")));
}

#[test]
fn a_tool_that_nobody_sizes_suits_its_bodies() {
    let path: PathBuf = std::env::temp_dir().join(format!("palpate-scene-{}.palpate", std::process::id()));
    green("").save(&path).expect("a writable folder");
    let prepared = Scene::load(&path).and_then(|scene| scene.prepare()).expect("a scene of one store");
    std::fs::remove_file(&path).expect("the store");
    let tool = &prepared.model.tools[0];
    assert_eq!((tool.radius, tool.law), (0.1 / 16.0, LawKind::PATCH), "no constants at the surface: a patch");
    let mut scene = Scene::default();
    scene.add_body(body(ONE)).expect("room");
    scene.add_tool(Tool::default()).expect("room");
    assert_eq!(scene.prepare().expect("a scene").model.tools[0].law, LawKind::LOCAL);
    // Wider than any patch can be: shortened to what the surface takes.
    assert!(largest_contact_radius(&green(""), 1e-3) == 1e-3);
}
