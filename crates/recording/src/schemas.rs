//! Schemas of the messages, as ROS 2 interface definitions.

const LINE: &str = "================================================================================\n";

const TIME: (&str, &str) = ("builtin_interfaces/Time", "int32 sec\nuint32 nanosec\n");
const HEADER: (&str, &str) = ("std_msgs/Header", "builtin_interfaces/Time stamp\nstring frame_id\n");
const POINT: (&str, &str) = ("geometry_msgs/Point", "float64 x\nfloat64 y\nfloat64 z\n");
const VECTOR: (&str, &str) = ("geometry_msgs/Vector3", "float64 x\nfloat64 y\nfloat64 z\n");
const QUATERNION: (&str, &str) = ("geometry_msgs/Quaternion", "float64 x\nfloat64 y\nfloat64 z\nfloat64 w\n");
const POSE: (&str, &str) =
    ("geometry_msgs/Pose", "geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation\n");
const TWIST: (&str, &str) = ("geometry_msgs/Twist", "geometry_msgs/Vector3 linear\ngeometry_msgs/Vector3 angular\n");
const WRENCH: (&str, &str) = ("geometry_msgs/Wrench", "geometry_msgs/Vector3 force\ngeometry_msgs/Vector3 torque\n");

const FAULT: (&str, &str) = (
    "palpate_msgs/Fault",
    "# 0 none, 1 wrench not finite, 2 reading not finite, 3 stale input, 4 jumping input, 5 overrun, 6 store lost, 7 panic, 8 contact unsound;
# of the device: 10 disconnected, 11 stale, 12 not finite, 13 motors off, 14 its driver's own, by number, 15 its program has failed
uint8 kind
int32 driver_code
",
);
const TOOL: (&str, &str) = (
    "palpate_msgs/Tool",
    "geometry_msgs/Pose pose            # of the tip as the device said it, m, in the world
geometry_msgs/Twist twist          # m/s, rad/s
uint64 measured_ns                 # when the device measured it, by its own clock
uint32 buttons                     # a bit each
bool active                        # in the scene
palpate_msgs/Fault reading_fault   # instead of a reading
palpate_msgs/Fault fault_before    # latched when the tick began
palpate_msgs/Fault fault           # latched when it ended
bool limited                       # held back by the limit of strain
geometry_msgs/Wrench wrench        # on the device, after the safety stage: N, and N m about the tip
geometry_msgs/Wrench computed      # before the safety stage
geometry_msgs/Wrench law           # before the limit of strain
float32[3] port_energy             # given to the hand, owed to it and never paid, J, to five digits
",
);
const CONTACT: (&str, &str) = (
    "palpate_msgs/Contact",
    "# To five digits; vectors in the world.
uint8 tool
uint8 body
uint8 mode                         # 1 presses, 2 holds on
bool slipping
bool limited
float32[3] point                   # on the untouched surface, m
float32[3] normal
float32[3] force                   # on the body, N
float32[3] torque                  # on the body about the tip, N m
float32 radius                     # of the contact, m
float32 depth                      # of the tool in the surface at rest, m
float32 stiffness                  # along the normal, N/m
float32 error                      # estimated, of the force, relative; 0 for a linear material
",
);
const BODY: (&str, &str) = (
    "palpate_msgs/Body",
    "uint8 body
float64 time                       # that it has gone through, s
float64 kinetic                    # J, as are those below
float64 strain
float64 coupling
float64 dissipated
float64 work
",
);
const STRAIN: (&str, &str) = (
    "palpate_msgs/Strain",
    "uint8 body
uint64 asked                       # number of the tick that asked for it
",
);
const TICK: &str = "builtin_interfaces/Time stamp
uint64 number                      # ticks since the recording began
uint64 due_ns                      # monotonic clock
float64 period                     # s
uint32 delay_ns                    # from due to begun
uint32 took_ns
bool reset                         # everything was let go of
bool strike                        # that of the settings was given
palpate_msgs/Fault fault           # of the whole loop when the tick began
uint32 unasked                     # a bit for each body whose strain could not be asked for
palpate_msgs/Tool[] tools
palpate_msgs/Contact[] contacts
palpate_msgs/Body[] bodies         # those in motion
palpate_msgs/Strain[] strain       # responses that came before the tick
";
const SETTINGS: &str = "builtin_interfaces/Time stamp
uint64 number                      # tick from which they hold
float64[] contact_radius           # of each tool, m
float64[] friction                 # of each tool
float64[] stiffness_scale          # of each body
float64 strain_limit
float64 time_scale
uint8 strike_body
float64[3] strike_point            # m
float64[3] strike_impulse          # N s
float64 strike_radius              # m
float64 strike_duration            # s
";
const LOG: &str = "builtin_interfaces/Time stamp
uint8 level
string name
string msg
string file
string function
uint32 line
";

/// Names of the messages.
pub const NAMES: [&str; 5] = [
    "palpate_msgs/msg/Tick",
    "palpate_msgs/msg/Settings",
    "rcl_interfaces/msg/Log",
    "geometry_msgs/msg/PoseStamped",
    "geometry_msgs/msg/WrenchStamped",
];

/// Definition of a message with all that it is made of.
pub fn definition(name: &str) -> String {
    match name {
        "palpate_msgs/msg/Tick" => {
            let parts = [TIME, FAULT, TOOL, POSE, POINT, QUATERNION, TWIST, VECTOR, WRENCH, CONTACT, BODY, STRAIN];
            with(TICK, &parts)
        }
        "palpate_msgs/msg/Settings" => with(SETTINGS, &[TIME]),
        "geometry_msgs/msg/PoseStamped" => {
            with("std_msgs/Header header\ngeometry_msgs/Pose pose\n", &[HEADER, TIME, POSE, POINT, QUATERNION])
        }
        "geometry_msgs/msg/WrenchStamped" => {
            with("std_msgs/Header header\ngeometry_msgs/Wrench wrench\n", &[HEADER, TIME, WRENCH, VECTOR])
        }
        _ => with(LOG, &[TIME]),
    }
}

fn with(message: &str, parts: &[(&str, &str)]) -> String {
    let part = |(name, text): &(&str, &str)| format!("{LINE}MSG: {name}\n{text}");
    message.to_owned() + &parts.iter().map(part).collect::<String>()
}
