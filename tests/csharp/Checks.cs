// Checks of Palpate.cs that need its internals: checks SCENE. Prints "ok", or throws.
using System;
using Palpate;

static class Checks
{
    static int Main(string[] arguments)
    {
        RotationsAreMirrored();
        ForcesAreMirrored(arguments[0]);
        RefusedCallsThrow(arguments[0]);
        ForgottenScenesAreFreedOnce(arguments[0]);
        Console.WriteLine("ok");
        return 0;
    }

    static void Require(bool holds, string what)
    {
        if (!holds) throw new Exception(what);
    }

    // v + 2 w (u x v) + 2 u x (u x v), with u the vector part of q.
    static Vector Turned(Rotation q, Vector v)
    {
        var u = new Vector(q.X, q.Y, q.Z);
        Vector once = Cross(u, v), twice = Cross(u, once);
        return new Vector(v.X + 2 * (q.W * once.X + twice.X), v.Y + 2 * (q.W * once.Y + twice.Y), v.Z + 2 * (q.W * once.Z + twice.Z));
    }

    static Vector Cross(Vector a, Vector b)
    {
        return new Vector(a.Y * b.Z - a.Z * b.Y, a.Z * b.X - a.X * b.Z, a.X * b.Y - a.Y * b.X);
    }

    static double Distance(Vector a, Vector b)
    {
        return new Vector(a.X - b.X, a.Y - b.Y, a.Z - b.Z).Length;
    }

    // Turning and then mirroring is mirroring and then turning by the mirrored rotation.
    static void RotationsAreMirrored()
    {
        var q = new Rotation(0.5, 0.1, -0.7, 0.5);
        var v = new Vector(0.3, -0.2, 0.9);
        foreach (Axes axes in new[] { Axes.UnityFromZUp, Axes.UnityFromYUp })
        {
            Vector one = Palpate.Convert.Swap(Turned(q, v), axes);
            Vector other = Turned(Palpate.Convert.Swap(q, axes), Palpate.Convert.Swap(v, axes));
            Require(Distance(one, other) < 1e-15, "a rotation is not mirrored: " + axes);
            Vector w = Palpate.Convert.Swap(Palpate.Convert.Swap(v, axes), axes);
            Require(w.Equals(v), "a vector does not come back: " + axes);
        }
        // z up in Palpate is y up in Unity.
        Require(Palpate.Convert.Swap(new Vector(0, 0, 1), Axes.UnityFromZUp).Y == 1, "up is not up");
    }

    static void ForcesAreMirrored(string path)
    {
        using (var scene = new Scene(path))
        using (var mirrored = new Scene(path, Axes.UnityFromZUp))
        {
            int ticks = 300;
            var positions = new Vector[ticks, scene.Tools];
            var seen = new Vector[ticks, scene.Tools];
            for (int tick = 0; tick < ticks; tick++)
            {
                for (int tool = 0; tool < scene.Tools; tool++)
                {
                    positions[tick, tool] = new Vector(0.04 + 1e-5 * tick, 0.025, 0.057 - 1.5e-5 * tick + 0.05 * tool);
                    seen[tick, tool] = Palpate.Convert.Swap(positions[tick, tool], Axes.UnityFromZUp);
                }
            }
            Vector[,] forces = scene.Run(positions), others = mirrored.Run(seen);
            bool pressed = false;
            for (int tick = 0; tick < ticks; tick++)
            {
                Vector f = forces[tick, 0], g = others[tick, 0];
                Require(f.X == g.X && f.Y == g.Z && f.Z == g.Y, "a force is not mirrored");
                pressed |= f.Z > 0.01;
            }
            Require(pressed, "nothing was pressed");
        }
    }

    static void RefusedCallsThrow(string path)
    {
        try
        {
            new Scene("none.pack");
            throw new Exception("a missing scene was loaded");
        }
        catch (PalpateException refused)
        {
            Require(refused.Message.Contains("none.pack") && refused.Status < 0, refused.Message);
        }
        using (var scene = new Scene(path))
        {
            scene.Dispose();
            try
            {
                scene.Run(new Vector[1, scene.Tools]);
                throw new Exception("a freed scene was used");
            }
            catch (ObjectDisposedException)
            {
            }
        }
    }

    static void Forget(string path)
    {
        new Scene(path);
        var disposed = new Scene(path);
        disposed.Dispose();
        disposed.Dispose();
    }

    static void ForgottenScenesAreFreedOnce(string path)
    {
        int before = SceneHandle.Freed;
        // Frames of methods that have returned may still hold a reference: eight calls deep they are overwritten.
        for (int round = 0; round < 8; round++) Deep(path, 8);
        for (int round = 0; round < 10; round++)
        {
            GC.Collect();
            GC.WaitForPendingFinalizers();
        }
        int freed = SceneHandle.Freed - before;
        // One of the forgotten ones may still look alive to a conservative collector; none is freed twice.
        Require(freed >= 15 && freed <= 16, "16 scenes were freed " + freed + " times");
    }

    static void Deep(string path, int left)
    {
        if (left == 0) Forget(path);
        else Deep(path, left - 1);
    }
}
