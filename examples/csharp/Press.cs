// Presses the top of a body by 3 mm and lets go, without a clock: one row of CSV a tick.
//
//   mcs Press.cs $PREFIX/include/Palpate.cs -out:press.exe
//   LD_LIBRARY_PATH=$PREFIX/lib mono press.exe liver.pack 400 > forces.csv
using System;
using System.Globalization;
using Palpate;

static class Press
{
    const double Depth = 3e-3;

    static int Main(string[] arguments)
    {
        if (arguments.Length < 1)
        {
            Console.Error.WriteLine("usage: press SCENE [TICKS]");
            return 2;
        }
        try
        {
            int ticks = arguments.Length > 1 ? int.Parse(arguments[1], CultureInfo.InvariantCulture) : 400;
            using (var scene = new Scene(arguments[0]))
            using (var loop = new ForceLoop(scene)) Run(loop, Top(loop.RestPositions(0)), ticks);
            return 0;
        }
        catch (PalpateException refused)
        {
            Console.Error.WriteLine("press: " + refused.Message);
            return 2;
        }
    }

    // The highest node of the surface, m.
    static Vector Top(Vector[] positions)
    {
        Vector top = positions[0];
        foreach (Vector position in positions)
        {
            if (position.Z > top.Z) top = position;
        }
        return top;
    }

    static void Run(ForceLoop loop, Vector top, int ticks)
    {
        const double period = 1e-3;
        var inputs = new ToolInput[1];
        var wrenches = new Wrench[1];
        Vector before = new Vector();
        Console.WriteLine("x_m,y_m,z_m,force_x_N,force_y_N,force_z_N");
        for (int tick = 0; tick < ticks; tick++)
        {
            double down = 0.5 * (1 - Math.Cos(2 * Math.PI * tick / ticks));
            var tip = new Vector(top.X, top.Y, top.Z + 0.02 - (0.02 + Depth) * down);
            inputs[0].Position = tip;
            if (tick > 0) inputs[0].Velocity = new Vector(0, 0, (tip.Z - before.Z) / period);
            before = tip;
            if (!loop.Tick(period, (ulong)tick * 1000000, inputs, wrenches))
            {
                loop.Refresh();
                throw new InvalidOperationException(loop.Fault);
            }
            Vector f = wrenches[0].Force;
            Console.WriteLine(string.Format(CultureInfo.InvariantCulture,
                "{0:G17},{1:G17},{2:G17},{3:G17},{4:G17},{5:G17}", tip.X, tip.Y, tip.Z, f.X, f.Y, f.Z));
        }
    }
}
