/*
 * Palpate: soft bodies for haptics. The C interface of libpalpate.
 *
 * Guide with examples: docs/c-api.md. This file is generated; do not edit it.
 *
 * Units are SI: m, N, Pa, kg, s, rad. Axes are right-handed. Orientations are unit quaternions w x y z, world from
 * tool or body. Forces are those on the device, unless a comment says on the body.
 *
 * Pointers. A null pointer is refused by name, unless a comment says that it may be null. Arrays have the length that
 * stands beside them. A handle is valid from the call that fills it to the one that frees it. Structs whose first member
 * is struct_size may grow: set it to sizeof the struct, or fill the struct by its _init function; what a newer library
 * knows beyond is then its default.
 *
 * Errors. Every function that can fail returns a palpate_status. A negative one is a call that was refused and changed
 * nothing; palpate_last_error() says why, for each thread by itself. No exception and no panic leaves the library.
 *
 * Threads.
 *   palpate_store   never changes: any threads at the same time.
 *   palpate_scene   one thread at a time.
 *   palpate_loop    palpate_loop_tick from one thread at a time, which may be a device's callback: it never allocates,
 *                   waits or reads files, and nothing that other calls do makes it wait. A second thread in the tick gets
 *                   PALPATE_ERROR_BUSY. All other palpate_loop_ functions from any other threads meanwhile: they wait
 *                   for each other, never for the tick. Frames come through a wait-free hand-off.
 *   palpate_loop_free, palpate_scene_free, palpate_store_free: when no other thread is in a call with the object.
 *   The library must not be unloaded (dlclose) while a loop is alive: the loop's threads run in it.
 *
 * The interface is stable within a major number (PALPATE_ABI_MAJOR), which stands in the library's run-time name.
 */


#ifndef PALPATE_H
#define PALPATE_H

#include <stddef.h>
#include <stdint.h>


// Raised when a program must be compiled again; part of the library's run-time name.
#define PALPATE_ABI_MAJOR 1

// Raised when something has been added.
#define PALPATE_ABI_MINOR 0

// A condition on a surface node displaces it, m; components that are not numbers stay as they are.
#define PALPATE_CONDITION_DISPLACEMENT 0

// A condition on a surface node is a force, N, besides the body's own loads.
#define PALPATE_CONDITION_FORCE 1

// A condition on a surface node takes its support away; its value does not matter.
#define PALPATE_CONDITION_RELEASE 2

// A sphere of `radius` around the tool's origin.
#define PALPATE_SHAPE_SPHERE 0

// An ellipsoid of `semi_axes`.
#define PALPATE_SHAPE_ELLIPSOID 1

// A cylinder of `radius` and `length` along z, with a hemisphere around the origin and one at its other end.
#define PALPATE_SHAPE_CAPSULE 2

// A cylinder of `radius` along z, whose flat face with a rim of `rounding` lies in the plane z = 0.
#define PALPATE_SHAPE_PUNCH 3

// A closed surface of `vertices` and `triangles`.
#define PALPATE_SHAPE_SURFACE 4

// The local law where the elastic constants of every body are known, else patches.
#define PALPATE_LAW_DEFAULT 0

// Contact with a half-space in series with the finite elements: slides and rubs.
#define PALPATE_LAW_LOCAL 1

// A disc of `contact_radius` that sticks to what it first touched; for spheres.
#define PALPATE_LAW_PATCH 2

// The node closest to where the tool first touched; for spheres.
#define PALPATE_LAW_NODE 3

// Of palpate_reading.buttons: the tool holds on to what it touches.
#define PALPATE_BUTTON_GRAB 1

// Most tools of a scene.
#define PALPATE_MAX_TOOLS 4

// Most contacts at once.
#define PALPATE_MAX_CONTACTS 24

// Bytes of palpate_frame.fault.
#define PALPATE_FAULT_BYTES 192

// What a function returns: negative for a refused call, which has changed nothing.
enum palpate_status
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    // Done.
    PALPATE_OK = 0,
    // A fault has latched: the tools that it concerns have no wrench until palpate_loop_reset.
    PALPATE_FAULT = 1,
    // A null pointer, a wrong length, an unknown handle, a number out of range.
    PALPATE_ERROR_ARGUMENT = -1,
    // The operating system's: a file that cannot be read, no thread, no memory.
    PALPATE_ERROR_SYSTEM = -2,
    // A store or packed scene that is damaged, of another version, or does not belong to the scene.
    PALPATE_ERROR_STORE = -3,
    // An equation without an answer, or one that the store's digits do not carry.
    PALPATE_ERROR_SOLVE = -4,
    // Not now: the loop's own thread runs, or does not.
    PALPATE_ERROR_STATE = -5,
    // Another thread is within a tick of the same loop.
    PALPATE_ERROR_BUSY = -6,
    // A mistake within the library: please report it.
    PALPATE_ERROR_INTERNAL = -7,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum palpate_status palpate_status;
#else
typedef int32_t palpate_status;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// A force loop. One thread at a time may tick it; any other threads may read frames and change settings meanwhile.
typedef struct palpate_loop palpate_loop;

// What to touch, and with what. One thread at a time may use it.
typedef struct palpate_scene palpate_scene;

// A Green's function in memory. It never changes: any threads may use it at the same time.
typedef struct palpate_store palpate_store;

// What a store holds. Set struct_size before it is filled.
typedef struct palpate_store_info {
    // sizeof(palpate_store_info).
    uint32_t struct_size;
    // Nodes on the surface.
    uint32_t nodes;
    // Triangles that the surface is drawn by.
    uint32_t triangles;
    // Nodes that may be touched.
    uint32_t touchable_nodes;
    // Lower corner of the box around the body at rest, m.
    double lowest[3];
    // Upper corner of that box, m.
    double highest[3];
    // Young's modulus, Pa, if the whole body has one and no loads; else 0.
    double youngs_modulus;
    // Estimated relative error of the force on a pressed patch.
    double touch_error;
    // Whether the elastic constants at the surface are known, as the local contact law needs them.
    uint32_t knows_surface;
    // 0.
    uint32_t reserved;
} palpate_store_info;

// A condition on a surface node. Never grows.
typedef struct palpate_condition {
    // The surface node: its row in palpate_store_get_positions.
    uint32_t node;
    // PALPATE_CONDITION_DISPLACEMENT, _FORCE or _RELEASE.
    uint32_t kind;
    // m or N; a component that is not a number (NAN) is left as it is.
    double value[3];
} palpate_condition;

// Where a body stands and what it is made of. Fill it by palpate_body_options_init first.
typedef struct palpate_body_options {
    // sizeof(palpate_body_options).
    uint32_t struct_size;
    // 0.
    uint32_t reserved;
    // Of the body's own origin, m.
    double position[3];
    // World from body, a unit quaternion w x y z.
    double orientation[4];
    // Young's modulus at the surface, Pa, of a body of one material whose store does not say it; 0 for what the store says.
    double youngs_modulus;
    // Poisson's ratio at the surface.
    double poissons_ratio;
} palpate_body_options;

// What a tool looks like and how it touches. Fill it by palpate_tool_options_init first.
typedef struct palpate_tool_options {
    // sizeof(palpate_tool_options).
    uint32_t struct_size;
    // PALPATE_SHAPE_...
    uint32_t shape;
    // Of sphere, capsule and punch, m; 0 for a sphere of a sixteenth of the smallest body.
    double radius;
    // Of a capsule: distance between the centres of its hemispheres, m.
    double length;
    // Of a punch: radius of its rim, m.
    double rounding;
    // Of an ellipsoid, m.
    double semi_axes[3];
    // Of a surface: x y z of each vertex, m; read when the tool is added.
    const double *vertices;
    // Vertices of a surface.
    size_t vertex_count;
    // Of a surface: three vertices of each triangle, outward.
    const uint32_t *triangles;
    // Triangles of a surface.
    size_t triangle_count;
    // PALPATE_LAW_...
    uint32_t law;
    // 0.
    uint32_t reserved;
    // Radius of patches, and of what a grab holds, m; 0 for one that suits the bodies.
    double contact_radius;
    // Coulomb's coefficient of friction; 0 slides freely.
    double friction;
    // Young's modulus of its pad, Pa; 0 for a rigid tool.
    double pad_youngs_modulus;
    // Stiffest contact rendered, N/m.
    double max_stiffness;
} palpate_tool_options;

// What the device of a tool can render, for loops that the program ticks. Fill it by palpate_device_limits_init, a device
// without hardware, or by palpate_device_limits_known first. What is INFINITY is not limited.
typedef struct palpate_device_limits {
    // sizeof(palpate_device_limits).
    uint32_t struct_size;
    // 0.
    uint32_t reserved;
    // Largest force, N.
    double max_force;
    // Largest torque, N m.
    double max_torque;
    // Stiffest contact that it holds without oscillating, N/m.
    double max_stiffness;
    // Strongest damping that it holds, N s/m.
    double max_damping;
    // Strongest damping of rotation that it holds, N m s/rad.
    double max_angular_damping;
    // Damping of its own mechanics at the tip, N s/m; 0 where it is not known.
    double own_damping;
    // Time from a measurement to the force that answers it beyond that of the tick, s.
    double delay;
    // Fastest that a hand moves its tip, m/s: what looks faster is a fault of its sensors.
    double max_speed;
    // Fastest rate at which it takes wrenches, Hz.
    double rate;
} palpate_device_limits;

// Limits of the safety stage, and how the loop's own thread runs. Read those of a scene by palpate_scene_get_options first.
typedef struct palpate_scene_options {
    // sizeof(palpate_scene_options).
    uint32_t struct_size;
    // Priority of the loop's own thread under SCHED_FIFO, 1 to 99, where the system grants it; 0 asks for none.
    uint32_t priority;
    // Largest force, N.
    double max_force;
    // Fastest change of the force other than a release, N/s.
    double max_slew;
    // Largest torque, N m.
    double max_torque;
    // Fastest change of the torque other than a release, N m/s.
    double max_torque_slew;
    // Time over which forces are let in after the start and after a reset, s.
    double ramp;
    // Largest strain to which tools may take a body; 0 for any.
    double strain_limit;
    // Ticks a second of the loop's own thread, 100 to 10000 Hz, and of palpate_scene_run.
    double rate;
} palpate_scene_options;

// Where a simulated tool should go; it follows as a light damped hand. Never grows.
typedef struct palpate_target {
    // Of the tip, m, in the world.
    double position[3];
    // World from tool, a unit quaternion w x y z; four zeros do not turn it.
    double orientation[4];
    // At which the target goes on from there for a tenth of a second at most, m/s.
    double velocity[3];
    // Whether the tool is in the scene: 0 or 1.
    uint32_t active;
    // Whether it holds on to what it touches: 0 or 1.
    uint32_t grab;
} palpate_target;

// What a device says at a tick. Never grows.
typedef struct palpate_reading {
    // Of the tip, m, in the world.
    double position[3];
    // World from tool, a unit quaternion w x y z; four zeros for a device that does not turn.
    double orientation[4];
    // Of the tip, m/s, in the world.
    double velocity[3];
    // Angular velocity, rad/s, in the world.
    double angular_velocity[3];
    // When the device measured this, ns, by any clock that only goes forward; 0 for the time of the tick. A tool whose
    // time stands still for 50 ms while it is in the scene is a fault.
    uint64_t timestamp_ns;
    // PALPATE_BUTTON_...
    uint32_t buttons;
    // Whether the tool is in the scene: 0 or 1.
    uint32_t active;
} palpate_reading;

// Force and torque. Never grows.
typedef struct palpate_wrench {
    // N, in the world.
    double force[3];
    // About the tip, N m, in the world.
    double torque[3];
} palpate_wrench;

// Times, us. Never grows.
typedef struct palpate_times {
    // Half are below.
    double p50;
    // 99 % are below.
    double p99;
    // 99.9 % are below.
    double p999;
    // The largest.
    double max;
} palpate_times;

// Numbers of a tick; tools stand in the order in which they were added to the scene. Set struct_size before it is filled.
typedef struct palpate_frame {
    // sizeof(palpate_frame).
    uint32_t struct_size;
    // Tools of the loop.
    uint32_t tools;
    // Contacts that palpate_loop_get_contacts writes.
    uint32_t contacts;
    // Whether a fault has latched: 0 or 1.
    uint32_t faulty;
    // What happened, and what to do; empty without a fault.
    char fault[PALPATE_FAULT_BYTES];
    // Ticks since the start.
    uint64_t ticks;
    // Time since the first tick, s.
    double time;
    // Force on each device, N.
    double forces[PALPATE_MAX_TOOLS][3];
    // Torque about each tip, N m.
    double torques[PALPATE_MAX_TOOLS][3];
    // Tip of each tool, m.
    double positions[PALPATE_MAX_TOOLS][3];
    // Orientation of each tool, w x y z.
    double orientations[PALPATE_MAX_TOOLS][4];
    // Whether each tool is in the scene: 0 or 1.
    uint32_t active[PALPATE_MAX_TOOLS];
    // Whether the limit of strain keeps each tool from following its device: 0 or 1.
    uint32_t limited[PALPATE_MAX_TOOLS];
    // How long ticks take, us.
    struct palpate_times compute_us;
    // How late ticks begin, us.
    struct palpate_times wakeup_us;
    // Deadlines that passed within ticks that took too long.
    uint64_t missed_computing;
    // Deadlines that passed before ticks that began too late.
    uint64_t missed_waking;
    // Whether the system granted the loop's own thread real-time scheduling: 0 or 1.
    uint32_t realtime;
    // Whether the system granted that thread locked memory: 0 or 1.
    uint32_t locked_memory;
} palpate_frame;

// A contact; vectors are in the world. Never grows.
typedef struct palpate_contact {
    // Handle of the tool.
    uint32_t tool;
    // Handle of the body.
    uint32_t body;
    // Whether the tool holds on: 0 or 1.
    uint32_t grabs;
    // Whether it slips: 0 or 1.
    uint32_t slips;
    // Whether the limit of strain holds it back: 0 or 1.
    uint32_t limited;
    // 0.
    uint32_t reserved;
    // Contact point on the untouched surface, m.
    double point[3];
    // Outward unit normal there.
    double normal[3];
    // On the body, N.
    double force[3];
    // On the body about the contact point, N m.
    double torque[3];
    // Radius of the contact, m, under the local law; 0 otherwise, as what follows.
    double radius;
    // Depth, m, under the local law.
    double depth;
    // Stiffness, N/m, under the local law.
    double stiffness;
} palpate_contact;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

// The interface that the library was built with: PALPATE_ABI_MAJOR * 65536 + PALPATE_ABI_MINOR.
uint32_t palpate_abi_version(void);

// Version of the library, such as "0.1.0".
const char *palpate_version(void);

// What was wrong with the calling thread's last refused call, in one line; empty if there was none. Valid until the next
// refused call of that thread.
const char *palpate_last_error(void);

// Nanoseconds of the monotonic clock by which ticks are timed (CLOCK_MONOTONIC).
uint64_t palpate_now_ns(void);

// Reads a store (.palpate) and verifies every block of it.
palpate_status palpate_store_load(const char *file, struct palpate_store **store);

// Frees a store; bodies made of it keep what they need. Null is nothing.
void palpate_store_free(struct palpate_store *store);

// Says what a store holds.
palpate_status palpate_store_get_info(const struct palpate_store *store, struct palpate_store_info *info);

// Rest positions of the surface nodes, x y z of each, m, in the body's own frame.
palpate_status palpate_store_get_positions(const struct palpate_store *store,
                                           double *positions,
                                           size_t nodes);

// Triangles that the surface is drawn by, outward, three numbers of surface nodes each.
palpate_status palpate_store_get_triangles(const struct palpate_store *store,
                                           uint32_t *nodes,
                                           size_t triangles);

// Presses the patch of `radius` (m; 0 is a point) around the surface point closest to `point` (m, in the body's own frame)
// by `displacement` (m; NAN leaves a component free). `force` (N) is that on the body; `displacements` are those of the
// surface nodes, x y z of each, m, or null; `error` is the estimated relative error, or null.
palpate_status palpate_store_touch(const struct palpate_store *store,
                                   const double *point,
                                   const double *displacement,
                                   double radius,
                                   double *force,
                                   double *displacements,
                                   size_t nodes,
                                   double *error);

// Answers a change of boundary conditions exactly. `displacements` (m) and `forces` (N: K u, with applied loads, contact
// forces and reactions of supports) are of the surface nodes, x y z of each, and may be null; so may `error`.
palpate_status palpate_store_solve(const struct palpate_store *store,
                                   const struct palpate_condition *conditions,
                                   size_t count,
                                   double *displacements,
                                   double *forces,
                                   size_t nodes,
                                   double *error);

// Fills the options of a body with defaults: at the origin, not turned. Pass sizeof(palpate_body_options).
palpate_status palpate_body_options_init(struct palpate_body_options *options, size_t struct_size);

// Fills the options of a tool with defaults: a ball that suits the bodies. Pass sizeof(palpate_tool_options).
palpate_status palpate_tool_options_init(struct palpate_tool_options *options, size_t struct_size);

// Fills the limits of a device: none at all, a device without hardware. Pass sizeof(palpate_device_limits).
palpate_status palpate_device_limits_init(struct palpate_device_limits *limits, size_t struct_size);

// Fills the limits of a device that is sold, by its name: Touch, PHANTOM Omni, PHANTOM Desktop, Falcon, omega, sigma.7,
// lambda.7 or Inverse3. Pass sizeof(palpate_device_limits).
palpate_status palpate_device_limits_known(const char *name,
                                           struct palpate_device_limits *limits,
                                           size_t struct_size);

// Makes a scene without bodies and tools.
palpate_status palpate_scene_new(struct palpate_scene **scene);

// Reads a scene that `palpate pack` has written (the folder), or a bare store (.palpate) with a tool that suits it.
palpate_status palpate_scene_load(const char *file,
                                  struct palpate_scene **scene);

// Frees a scene; loops made of it go on. Null is nothing.
void palpate_scene_free(struct palpate_scene *scene);

// Adds a body made of a store, four at most. `options` may be null: at the origin. `body` gets its handle, or is null.
palpate_status palpate_scene_add_body(struct palpate_scene *scene,
                                      const struct palpate_store *store,
                                      const struct palpate_body_options *options,
                                      uint32_t *body);

// Moves a body of the scene: position, m, and orientation, a unit quaternion w x y z.
palpate_status palpate_scene_place_body(struct palpate_scene *scene,
                                        uint32_t body,
                                        const double *position,
                                        const double *orientation);

// Takes a body out of the scene; loops that were made before keep it.
palpate_status palpate_scene_remove_body(struct palpate_scene *scene, uint32_t body);

// Adds a tool, four at most. `options` may be null: a ball that suits the bodies. `tool` gets its handle, or is null.
palpate_status palpate_scene_add_tool(struct palpate_scene *scene,
                                      const struct palpate_tool_options *options,
                                      uint32_t *tool);

// Takes a tool out of the scene; loops that were made before keep it.
palpate_status palpate_scene_remove_tool(struct palpate_scene *scene, uint32_t tool);

// States what the device of a tool can render: the safety stage keeps it, and a tool that is stiffer is refused by
// palpate_loop_new.
palpate_status palpate_scene_set_device(struct palpate_scene *scene,
                                        uint32_t tool,
                                        const struct palpate_device_limits *limits);

// Reads limits and scheduling of a scene. Set struct_size before.
palpate_status palpate_scene_get_options(const struct palpate_scene *scene,
                                         struct palpate_scene_options *options);

// Changes limits and scheduling of a scene, for loops that are made from now on.
palpate_status palpate_scene_set_options(struct palpate_scene *scene,
                                         const struct palpate_scene_options *options);

// How many bodies and tools a scene has; either place may be null.
palpate_status palpate_scene_get_counts(const struct palpate_scene *scene, size_t *bodies, size_t *tools);

// Moves the tools of a scene through positions, one tick a row: `positions` (ticks x tools, x y z, m; NAN takes a tool out of the
// scene) and `orientations` (ticks x tools, w x y z; null does not turn them). `forces` gets the force on each device
// after the safety stage (ticks x tools, N), `torques` that about each tip (N m), or is null.
//
// Returns PALPATE_FAULT where a fault has latched; forces are zero from there on.
palpate_status palpate_scene_run(const struct palpate_scene *scene,
                                 size_t ticks,
                                 size_t tools,
                                 const double *positions,
                                 const double *orientations,
                                 double *forces,
                                 double *torques);

// Makes the loop of a scene as it is now, at rest, to be ticked by the program: seconds for large bodies. What changes in the
// scene later does not change it.
palpate_status palpate_loop_new(const struct palpate_scene *scene,
                                struct palpate_loop **force_loop);

// Ends a loop and frees it; no thread may be in a call with it. Null is nothing.
void palpate_loop_free(struct palpate_loop *force_loop);

// Starts a thread of the loop's own at the rate of the scene, with simulated devices that palpate_loop_set_target moves.
// Tools are out of the scene until then. The program cannot tick until palpate_loop_stop.
palpate_status palpate_loop_start(struct palpate_loop *force_loop);

// Stops that thread. The loop is at rest then, and for the program to tick; settings stay. Once more, it does nothing.
palpate_status palpate_loop_stop(struct palpate_loop *force_loop);

// Exchanges the bodies and tools of a loop for those of its scene as it is now, while the loop's own thread runs: contacts
// between those that stay go on, and new tools are out of the scene until they get a target. `scene` must be the one that the
// loop was made of. Takes as long as it takes to prepare what is new; the loop ticks meanwhile.
palpate_status palpate_loop_change(struct palpate_loop *force_loop,
                                   const struct palpate_scene *scene);

// Sends a simulated tool to a target, while the loop's own thread runs.
palpate_status palpate_loop_set_target(struct palpate_loop *force_loop,
                                       uint32_t tool,
                                       const struct palpate_target *target);

// Refuses devices that cannot be ticked with a time `period` between two ticks, s: ask once, before the first tick.
palpate_status palpate_loop_check_period(const struct palpate_loop *force_loop,
                                         double period);

// One tick: takes the readings of all tools, in the order in which they were added to the scene, and gives the wrenches on
// their devices, made safe. `now_ns` is the time for which it is due, by palpate_now_ns; `period` the time between two
// ticks, s. For a device's callback: it never allocates, locks, waits or does files; only a refused call keeps a message.
//
// Returns PALPATE_OK, or PALPATE_FAULT where a fault has latched: palpate_loop_get_frame tells which. The tools that it
// concerns have no wrench then; after a refused call no tool has one.
palpate_status palpate_loop_tick(struct palpate_loop *force_loop,
                                 uint64_t now_ns,
                                 double period,
                                 const struct palpate_reading *readings,
                                 struct palpate_wrench *wrenches,
                                 size_t tools);

// Takes the latest tick and writes its numbers. Contacts and surfaces that are read next are of the same tick. Never waits for
// the tick; callers of frames and settings wait for each other.
palpate_status palpate_loop_get_frame(struct palpate_loop *force_loop,
                                      struct palpate_frame *frame);

// Contacts of the tick of the last palpate_loop_get_frame: `count` gets how many there are, of which `capacity` are written.
palpate_status palpate_loop_get_contacts(struct palpate_loop *force_loop,
                                         struct palpate_contact *contacts,
                                         size_t capacity,
                                         size_t *count);

// Estimated relative error of the force of each contact, in the order of palpate_loop_get_contacts; 0 for a linear material.
// `count` gets how many there are, of which `capacity` are written.
palpate_status palpate_loop_get_contact_errors(struct palpate_loop *force_loop,
                                               double *errors,
                                               size_t capacity,
                                               size_t *count);

// How many surface nodes and triangles a body has; either place may be null. They never change.
palpate_status palpate_loop_get_surface_size(const struct palpate_loop *force_loop,
                                             uint32_t body,
                                             size_t *nodes,
                                             size_t *triangles);

// Triangles of a body, outward, three numbers of surface nodes each.
palpate_status palpate_loop_get_triangles(const struct palpate_loop *force_loop,
                                          uint32_t body,
                                          uint32_t *nodes,
                                          size_t triangles);

// Positions of the surface nodes of a body at rest, without its loads, x y z of each, m, in the world.
palpate_status palpate_loop_get_rest_positions(const struct palpate_loop *force_loop,
                                               uint32_t body,
                                               double *positions,
                                               size_t nodes);

// Positions of the surface nodes of a body in the tick of the last palpate_loop_get_frame, x y z of each, m, in the world.
// Worked out by the caller, in some hundred microseconds: not for the thread that ticks.
palpate_status palpate_loop_get_positions(struct palpate_loop *force_loop,
                                          uint32_t body,
                                          double *positions,
                                          size_t nodes);

// Changes Coulomb's coefficient of friction of a tool.
palpate_status palpate_loop_set_friction(struct palpate_loop *force_loop, uint32_t tool, double friction);

// Changes the radius of contacts of a tool that begin from now on, m: of patches, and of what a grab holds.
palpate_status palpate_loop_set_contact_radius(struct palpate_loop *force_loop, uint32_t tool, double radius);

// Changes Young's modulus of a body to so many times that of its store: of a body of one material at rest, without loads.
palpate_status palpate_loop_set_stiffness_scale(struct palpate_loop *force_loop,
                                                uint32_t body,
                                                double scale);

// Changes the largest strain to which tools may take the bodies; 0 for any.
palpate_status palpate_loop_set_strain_limit(struct palpate_loop *force_loop, double limit);

// Changes how many seconds bodies in motion advance in a second: below one is slow motion.
palpate_status palpate_loop_set_time_scale(struct palpate_loop *force_loop, double scale);

// Strikes a body in motion: an impulse, N s, on the patch of `radius`, m, around the surface point closest to `point`, m, in the
// world; the force is half a wave of `duration`, s. Strikes that come faster than ticks are given one a tick, in order; 64 may
// wait.
palpate_status palpate_loop_strike(struct palpate_loop *force_loop,
                                   uint32_t body,
                                   const double *point,
                                   const double *impulse,
                                   double radius,
                                   double duration);

// Lets go of everything, brings bodies in motion to rest and clears a fault; forces ramp in anew.
palpate_status palpate_loop_reset(struct palpate_loop *force_loop);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* PALPATE_H */
