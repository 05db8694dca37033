// Palpate for C#: one file over libpalpate, for .NET, Mono and Unity. Guide: docs/csharp.md.
//
// Add this file to your project and put libpalpate.so where the loader finds it. Units are SI: m, N, s, rad. Vectors are in the axes that
// are chosen when a scene is loaded: those of Palpate (right-handed, z up), or Unity's (left-handed, y up).
//
// Objects are IDisposable; one that is forgotten is freed once by the garbage collector. A refused call throws PalpateException with the
// library's own line. A fault of the safety stage is no exception: forces are zero, and ForceLoop.Fault says why until Reset().
using System;
using System.Runtime.InteropServices;
using System.Text;

namespace Palpate
{
    /// <summary>A refused call: its message is the library's line.</summary>
    public sealed class PalpateException : Exception
    {
        /// <summary>The palpate_status of the C interface.</summary>
        public int Status { get; private set; }

        internal PalpateException(int status, string message) : base(message)
        {
            Status = status;
        }
    }

    /// <summary>Three numbers in the axes of a scene.</summary>
    [StructLayout(LayoutKind.Sequential)]
    public struct Vector
    {
        public double X, Y, Z;

        public Vector(double x, double y, double z)
        {
            X = x;
            Y = y;
            Z = z;
        }

        public double Length
        {
            get { return Math.Sqrt(X * X + Y * Y + Z * Z); }
        }
    }

    /// <summary>A unit quaternion; all zeros for a tool that does not turn.</summary>
    [StructLayout(LayoutKind.Sequential)]
    public struct Rotation
    {
        public double W, X, Y, Z;

        public Rotation(double w, double x, double y, double z)
        {
            W = w;
            X = x;
            Y = y;
            Z = z;
        }
    }

    /// <summary>Axes of the program. Conversions only exchange numbers and signs: they keep every bit.</summary>
    public enum Axes
    {
        /// <summary>Right-handed, as in files and in C.</summary>
        Palpate,

        /// <summary>Left-handed, y up, of a scene whose z is up: y and z are exchanged.</summary>
        UnityFromZUp,

        /// <summary>Left-handed, y up, of a scene whose y is up: z changes its sign.</summary>
        UnityFromYUp,
    }

    /// <summary>Where a tool is, and what it does.</summary>
    public struct ToolInput
    {
        /// <summary>Of the tip, m; NaN takes the tool out of the scene.</summary>
        public Vector Position;

        /// <summary>World from tool.</summary>
        public Rotation Orientation;

        /// <summary>Of the tip, m/s.</summary>
        public Vector Velocity;

        /// <summary>Whether it holds on to what it touches.</summary>
        public bool Grab;
    }

    /// <summary>Force and torque about the tip.</summary>
    public struct Wrench
    {
        /// <summary>N.</summary>
        public Vector Force;

        /// <summary>N m.</summary>
        public Vector Torque;
    }

    /// <summary>A contact of the latest frame.</summary>
    public struct Contact
    {
        public int Tool, Body;
        public bool Grabs, Slips, Limited;

        /// <summary>On the untouched surface, m, and the outward normal there.</summary>
        public Vector Point, Normal;

        /// <summary>On the body, N, and about the contact point, N m.</summary>
        public Vector Force, Torque;

        /// <summary>Contact radius, m, depth, m, and stiffness, N/m, of tools under the local law; else 0.</summary>
        public double Radius, Depth, Stiffness;
    }

    /// <summary>Bodies and tools: a scene of `palpate pack`, or a store. One thread at a time may use it.</summary>
    public sealed class Scene : IDisposable
    {
        internal readonly SceneHandle Handle;

        /// <summary>Axes of all vectors that go in and come out.</summary>
        public readonly Axes Axes;

        /// <summary>Numbers of bodies and of tools.</summary>
        public readonly int Bodies, Tools;

        /// <summary>Loads a folder of `palpate pack`, or a store.</summary>
        public Scene(string path, Axes axes = Axes.Palpate)
        {
            Axes = axes;
            Native.RequireLibrary();
            Native.Require(Native.palpate_scene_load(Native.Text(path), out Handle));
            UIntPtr bodies, tools;
            Native.Require(Native.palpate_scene_get_counts(Handle, out bodies, out tools));
            Bodies = (int)bodies;
            Tools = (int)tools;
        }

        /// <summary>Moves the tools through positions without a clock, one tick a row: forces on the tools [ticks, tools].</summary>
        public Vector[,] Run(Vector[,] positions, Rotation[,] orientations = null)
        {
            int ticks = positions.GetLength(0), tools = positions.GetLength(1);
            var places = new Vector[ticks, tools];
            var turned = orientations == null ? null : new Rotation[ticks, tools];
            var forces = new Vector[ticks, tools];
            for (int tick = 0; tick < ticks; tick++)
            {
                for (int tool = 0; tool < tools; tool++)
                {
                    places[tick, tool] = Convert.Swap(positions[tick, tool], Axes);
                    if (turned != null) turned[tick, tool] = Convert.Swap(orientations[tick, tool], Axes);
                }
            }
            int status = Native.palpate_scene_run(
                Handle, (UIntPtr)ticks, (UIntPtr)tools, places, turned, forces, IntPtr.Zero);
            if (status < 0) Native.Require(status);
            for (int tick = 0; tick < ticks; tick++)
            {
                for (int tool = 0; tool < tools; tool++) forces[tick, tool] = Convert.Swap(forces[tick, tool], Axes);
            }
            return forces;
        }

        /// <summary>Frees it, once; loops made of it go on.</summary>
        public void Dispose()
        {
            Handle.Dispose();
        }
    }

    /// <summary>The 1 kHz loop of a scene: on the library's thread (Start, Move), or ticked by the program (Tick).</summary>
    public sealed class ForceLoop : IDisposable
    {
        readonly LoopHandle handle;
        readonly Axes axes;
        readonly int tools;
        readonly Native.Reading[] readings;
        readonly Native.NativeWrench[] wrenches;
        readonly Native.NativeContact[] contacts = new Native.NativeContact[Native.MaxContacts];
        Native.Frame frame = new Native.Frame();

        /// <summary>Prepares the scene, at rest: seconds for large bodies.</summary>
        public ForceLoop(Scene scene)
        {
            axes = scene.Axes;
            tools = scene.Tools;
            readings = new Native.Reading[tools];
            wrenches = new Native.NativeWrench[tools];
            Native.Require(Native.palpate_loop_new(scene.Handle, out handle));
            Refresh();
        }

        /// <summary>Why forces are off until Reset(), of the last Refresh() or Tick(); empty without a fault.</summary>
        public string Fault { get; private set; }

        /// <summary>Starts the loop's own thread; tools are out of the scene until they are moved.</summary>
        public void Start()
        {
            Native.Require(Native.palpate_loop_start(handle));
        }

        /// <summary>Stops that thread.</summary>
        public void Stop()
        {
            Native.Require(Native.palpate_loop_stop(handle));
        }

        /// <summary>Sends a tool somewhere, while the loop's own thread runs. It follows as a light damped hand.</summary>
        public void Move(int tool, ToolInput to)
        {
            var target = new Native.Target
            {
                Position = Convert.Swap(to.Position, axes),
                Orientation = Convert.Swap(to.Orientation, axes),
                Velocity = Convert.Swap(to.Velocity, axes),
                Active = IsPlace(to.Position) ? 1u : 0u,
                Grab = to.Grab ? 1u : 0u,
            };
            if (target.Active == 0) target.Position = target.Velocity = new Vector();
            Native.Require(Native.palpate_loop_set_target(handle, (uint)tool, ref target));
        }

        /// <summary>One tick of the program's own loop: tools in, wrenches on them out. It allocates nothing.</summary>
        /// <param name="period">Time between two ticks, s.</param>
        /// <param name="dueNs">Time for which the tick is due, by NowNs.</param>
        /// <returns>Whether no fault has latched.</returns>
        public bool Tick(double period, ulong dueNs, ToolInput[] inputs, Wrench[] result)
        {
            if (inputs.Length != tools || result.Length != tools)
                throw new ArgumentException("a tick takes as many inputs and results as the scene has tools: " + tools);
            for (int tool = 0; tool < tools; tool++)
            {
                ToolInput input = inputs[tool];
                bool active = IsPlace(input.Position);
                readings[tool] = new Native.Reading
                {
                    Position = active ? Convert.Swap(input.Position, axes) : new Vector(),
                    Orientation = Convert.Swap(input.Orientation, axes),
                    Velocity = active ? Convert.Swap(input.Velocity, axes) : new Vector(),
                    Buttons = input.Grab ? 1u : 0u,
                    Active = active ? 1u : 0u,
                };
            }
            int status = Native.palpate_loop_tick(handle, dueNs, period, readings, wrenches, (UIntPtr)tools);
            if (status < 0) Native.Require(status);
            for (int tool = 0; tool < tools; tool++)
            {
                result[tool].Force = Convert.Swap(wrenches[tool].Force, axes);
                // A torque is a pseudovector: mirrored axes change its sign.
                result[tool].Torque = Convert.SwapTorque(wrenches[tool].Torque, axes);
            }
            return status == 0;
        }

        /// <summary>Nanoseconds of the clock by which ticks are timed.</summary>
        public static ulong NowNs
        {
            get { return Native.palpate_now_ns(); }
        }

        /// <summary>Takes the latest tick: what is read next belongs to it. It never waits for the tick.</summary>
        public void Refresh()
        {
            frame.StructSize = (uint)Marshal.SizeOf(typeof(Native.Frame));
            Native.Require(Native.palpate_loop_get_frame(handle, ref frame));
            int end = Array.IndexOf(frame.FaultText, (byte)0);
            Fault = frame.Faulty == 0 ? "" : Encoding.UTF8.GetString(frame.FaultText, 0, end < 0 ? 0 : end);
        }

        /// <summary>Time since the first tick, s, of the last Refresh().</summary>
        public double Time
        {
            get { return frame.Time; }
        }

        /// <summary>Force on a tool, N, of the last Refresh().</summary>
        public Vector Force(int tool)
        {
            RequireTool(tool);
            double[] f = frame.Forces;
            return Convert.Swap(new Vector(f[3 * tool], f[3 * tool + 1], f[3 * tool + 2]), axes);
        }

        /// <summary>Tip of a tool, m, of the last Refresh().</summary>
        public Vector Position(int tool)
        {
            RequireTool(tool);
            double[] p = frame.Positions;
            return Convert.Swap(new Vector(p[3 * tool], p[3 * tool + 1], p[3 * tool + 2]), axes);
        }

        /// <summary>Contacts of the last Refresh().</summary>
        public Contact[] Contacts()
        {
            UIntPtr count;
            Native.Require(
                Native.palpate_loop_get_contacts(handle, contacts, (UIntPtr)contacts.Length, out count));
            var answer = new Contact[(int)count];
            for (int rank = 0; rank < answer.Length; rank++)
            {
                Native.NativeContact c = contacts[rank];
                answer[rank] = new Contact
                {
                    Tool = (int)c.Tool,
                    Body = (int)c.Body,
                    Grabs = c.Grabs != 0,
                    Slips = c.Slips != 0,
                    Limited = c.Limited != 0,
                    Point = Convert.Swap(c.Point, axes),
                    Normal = Convert.Swap(c.Normal, axes),
                    Force = Convert.Swap(c.Force, axes),
                    Torque = Convert.SwapTorque(c.Torque, axes),
                    Radius = c.Radius,
                    Depth = c.Depth,
                    Stiffness = c.Stiffness,
                };
            }
            return answer;
        }

        /// <summary>Triangles of a body, three nodes each, outward by the winding of the program's axes.</summary>
        public int[] Triangles(int body)
        {
            UIntPtr nodes, count;
            Native.Require(Native.palpate_loop_get_surface_size(handle, (uint)body, out nodes, out count));
            var triangles = new int[3 * (int)count];
            Native.Require(Native.palpate_loop_get_triangles(handle, (uint)body, triangles, count));
            for (int first = 0; axes != Axes.Palpate && first < triangles.Length; first += 3)
            {
                int second = triangles[first + 1];
                triangles[first + 1] = triangles[first + 2];
                triangles[first + 2] = second;
            }
            return triangles;
        }

        /// <summary>Surface nodes of a body at rest, m.</summary>
        public Vector[] RestPositions(int body)
        {
            var positions = new Vector[Nodes(body)];
            Native.Require(
                Native.palpate_loop_get_rest_positions(handle, (uint)body, positions, (UIntPtr)positions.Length));
            return Swapped(positions);
        }

        /// <summary>Surface nodes of a body in the tick of the last Refresh(), m, into an array of Nodes(body).</summary>
        public void DeformedPositions(int body, Vector[] positions)
        {
            Native.Require(
                Native.palpate_loop_get_positions(handle, (uint)body, positions, (UIntPtr)positions.Length));
            Swapped(positions);
        }

        /// <summary>Surface nodes of a body.</summary>
        public int Nodes(int body)
        {
            UIntPtr nodes, triangles;
            Native.Require(Native.palpate_loop_get_surface_size(handle, (uint)body, out nodes, out triangles));
            return (int)nodes;
        }

        /// <summary>Changes Coulomb's coefficient of friction of a tool.</summary>
        public void SetFriction(int tool, double friction)
        {
            Native.Require(Native.palpate_loop_set_friction(handle, (uint)tool, friction));
        }

        /// <summary>Changes the largest strain to which tools may take the bodies; 0 for any.</summary>
        public void SetStrainLimit(double limit)
        {
            Native.Require(Native.palpate_loop_set_strain_limit(handle, limit));
        }

        /// <summary>Lets go of everything and clears a fault; forces ramp in anew.</summary>
        public void Reset()
        {
            Native.Require(Native.palpate_loop_reset(handle));
        }

        /// <summary>Ends the loop, once.</summary>
        public void Dispose()
        {
            handle.Dispose();
        }

        Vector[] Swapped(Vector[] vectors)
        {
            for (int rank = 0; rank < vectors.Length; rank++) vectors[rank] = Convert.Swap(vectors[rank], axes);
            return vectors;
        }

        void RequireTool(int tool)
        {
            if (tool < 0 || tool >= tools)
                throw new ArgumentOutOfRangeException("tool", "the scene has " + tools + " tools, there is no " + tool);
        }

        static bool IsPlace(Vector position)
        {
            double sum = position.X + position.Y + position.Z;
            return !double.IsNaN(sum) && !double.IsInfinity(sum);
        }
    }

    /// <summary>Palpate's axes to those of the program and back: each is its own inverse.</summary>
    static class Convert
    {
        internal static Vector Swap(Vector v, Axes axes)
        {
            switch (axes)
            {
                case Axes.UnityFromZUp: return new Vector(v.X, v.Z, v.Y);
                case Axes.UnityFromYUp: return new Vector(v.X, v.Y, -v.Z);
                default: return v;
            }
        }

        internal static Vector SwapTorque(Vector v, Axes axes)
        {
            Vector mirrored = Swap(v, axes);
            return axes == Axes.Palpate ? v : new Vector(-mirrored.X, -mirrored.Y, -mirrored.Z);
        }

        // A mirror M takes a rotation about n to one about -M n by the same angle.
        internal static Rotation Swap(Rotation q, Axes axes)
        {
            switch (axes)
            {
                case Axes.UnityFromZUp: return new Rotation(q.W, -q.X, -q.Z, -q.Y);
                case Axes.UnityFromYUp: return new Rotation(q.W, -q.X, -q.Y, q.Z);
                default: return q;
            }
        }
    }

    sealed class SceneHandle : SafeHandle
    {
        internal static int Freed;

        SceneHandle() : base(IntPtr.Zero, true) { }

        public override bool IsInvalid
        {
            get { return handle == IntPtr.Zero; }
        }

        protected override bool ReleaseHandle()
        {
            System.Threading.Interlocked.Increment(ref Freed);
            Native.palpate_scene_free(handle);
            return true;
        }
    }

    sealed class LoopHandle : SafeHandle
    {
        LoopHandle() : base(IntPtr.Zero, true) { }

        public override bool IsInvalid
        {
            get { return handle == IntPtr.Zero; }
        }

        protected override bool ReleaseHandle()
        {
            Native.palpate_loop_free(handle);
            return true;
        }
    }

    /// <summary>The C interface, as far as this file needs it: structs as in palpate.h.</summary>
    static class Native
    {
        const string Library = "palpate";
        const uint AbiMajor = 1;
        internal const int MaxContacts = 24;

        [StructLayout(LayoutKind.Sequential)]
        internal struct Reading
        {
            internal Vector Position;
            internal Rotation Orientation;
            internal Vector Velocity, AngularVelocity;
            internal ulong TimestampNs;
            internal uint Buttons, Active;
        }

        [StructLayout(LayoutKind.Sequential)]
        internal struct NativeWrench
        {
            internal Vector Force, Torque;
        }

        [StructLayout(LayoutKind.Sequential)]
        internal struct Target
        {
            internal Vector Position;
            internal Rotation Orientation;
            internal Vector Velocity;
            internal uint Active, Grab;
        }

        [StructLayout(LayoutKind.Sequential)]
        internal struct NativeContact
        {
            internal uint Tool, Body, Grabs, Slips, Limited, Reserved;
            internal Vector Point, Normal, Force, Torque;
            internal double Radius, Depth, Stiffness;
        }

        [StructLayout(LayoutKind.Sequential)]
        internal struct Frame
        {
            internal uint StructSize, Tools, ContactCount, Faulty;
            [MarshalAs(UnmanagedType.ByValArray, SizeConst = 192)] internal byte[] FaultText;
            internal ulong Ticks;
            internal double Time;
            [MarshalAs(UnmanagedType.ByValArray, SizeConst = 12)] internal double[] Forces;
            [MarshalAs(UnmanagedType.ByValArray, SizeConst = 12)] internal double[] Torques;
            [MarshalAs(UnmanagedType.ByValArray, SizeConst = 12)] internal double[] Positions;
            [MarshalAs(UnmanagedType.ByValArray, SizeConst = 16)] internal double[] Orientations;
            [MarshalAs(UnmanagedType.ByValArray, SizeConst = 4)] internal uint[] Active;
            [MarshalAs(UnmanagedType.ByValArray, SizeConst = 4)] internal uint[] Limited;
            [MarshalAs(UnmanagedType.ByValArray, SizeConst = 4)] internal double[] ComputeUs;
            [MarshalAs(UnmanagedType.ByValArray, SizeConst = 4)] internal double[] WakeupUs;
            internal ulong MissedComputing, MissedWaking;
            internal uint Realtime, LockedMemory;
        }

        internal static void RequireLibrary()
        {
            uint version = palpate_abi_version();
            if (version >> 16 != AbiMajor)
                throw new PalpateException(-1, "libpalpate has another interface than Palpate.cs: install both anew");
        }

        internal static void Require(int status)
        {
            if (status >= 0) return;
            IntPtr text = palpate_last_error();
            int length = 0;
            while (Marshal.ReadByte(text, length) != 0) length++;
            var bytes = new byte[length];
            Marshal.Copy(text, bytes, 0, length);
            throw new PalpateException(status, Encoding.UTF8.GetString(bytes));
        }

        /// <summary>UTF-8 with a zero at its end: the marshaller's own encoding depends on the system.</summary>
        internal static byte[] Text(string text)
        {
            return Encoding.UTF8.GetBytes(text + "\0");
        }

        [DllImport(Library)] static extern uint palpate_abi_version();
        [DllImport(Library)] static extern IntPtr palpate_last_error();
        [DllImport(Library)] internal static extern ulong palpate_now_ns();
        [DllImport(Library)] internal static extern int palpate_scene_load(byte[] file, out SceneHandle scene);
        [DllImport(Library)] internal static extern void palpate_scene_free(IntPtr scene);
        [DllImport(Library)] internal static extern int palpate_scene_get_counts(SceneHandle scene, out UIntPtr bodies, out UIntPtr tools);
        [DllImport(Library)] internal static extern int palpate_scene_run(
            SceneHandle scene, UIntPtr ticks, UIntPtr tools, [In] Vector[,] positions, [In] Rotation[,] orientations,
            [In, Out] Vector[,] forces, IntPtr torques);
        [DllImport(Library)] internal static extern int palpate_loop_new(SceneHandle scene, out LoopHandle loop);
        [DllImport(Library)] internal static extern void palpate_loop_free(IntPtr loop);
        [DllImport(Library)] internal static extern int palpate_loop_start(LoopHandle loop);
        [DllImport(Library)] internal static extern int palpate_loop_stop(LoopHandle loop);
        [DllImport(Library)] internal static extern int palpate_loop_reset(LoopHandle loop);
        [DllImport(Library)] internal static extern int palpate_loop_set_target(LoopHandle loop, uint tool, ref Target target);
        [DllImport(Library)] internal static extern int palpate_loop_tick(
            LoopHandle loop, ulong nowNs, double period, [In] Reading[] readings, [In, Out] NativeWrench[] wrenches, UIntPtr tools);
        [DllImport(Library)] internal static extern int palpate_loop_get_frame(LoopHandle loop, ref Frame frame);
        [DllImport(Library)] internal static extern int palpate_loop_get_contacts(
            LoopHandle loop, [In, Out] NativeContact[] contacts, UIntPtr capacity, out UIntPtr count);
        [DllImport(Library)] internal static extern int palpate_loop_get_surface_size(
            LoopHandle loop, uint body, out UIntPtr nodes, out UIntPtr triangles);
        [DllImport(Library)] internal static extern int palpate_loop_get_triangles(
            LoopHandle loop, uint body, [In, Out] int[] nodes, UIntPtr triangles);
        [DllImport(Library)] internal static extern int palpate_loop_get_rest_positions(
            LoopHandle loop, uint body, [In, Out] Vector[] positions, UIntPtr nodes);
        [DllImport(Library)] internal static extern int palpate_loop_get_positions(
            LoopHandle loop, uint body, [In, Out] Vector[] positions, UIntPtr nodes);
        [DllImport(Library)] internal static extern int palpate_loop_set_friction(LoopHandle loop, uint tool, double friction);
        [DllImport(Library)] internal static extern int palpate_loop_set_strain_limit(LoopHandle loop, double limit);
    }
}
