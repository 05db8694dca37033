// What a tick costs a program in C++: `tick_from_c SCENE POSITIONS PASSES`, for tick_from_c.py.
//
// Positions are ticks x 3 doubles of the first tool. Prints the shortest of the passes, ns a tick.
#include <palpate.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <iostream>
#include <limits>
#include <vector>

namespace {

bool done(palpate_status status) {
    if (status != PALPATE_OK) {
        std::cerr << "tick_from_c: " << palpate_last_error() << '\n';
    }
    return status == PALPATE_OK;
}

double measure(palpate_loop *loop, const std::vector<double> &positions, int passes) {
    using clock = std::chrono::steady_clock;
    constexpr double period = 1e-3;
    const std::size_t ticks = positions.size() / 3;
    palpate_reading reading{};
    palpate_wrench wrench{};
    reading.active = 1;
    std::uint64_t now = 0;
    double shortest = std::numeric_limits<double>::infinity();
    for (int pass = 0; pass < passes; ++pass) {
        bool faulty = false;
        const auto begun = clock::now();
        for (std::size_t tick = 0; tick < ticks; ++tick) {
            for (std::size_t axis = 0; axis < 3; ++axis) {
                const double x = positions[3 * tick + axis];
                reading.velocity[axis] = now == 0 ? 0.0 : (x - reading.position[axis]) / period;
                reading.position[axis] = x;
            }
            now += 1000000;
            faulty = palpate_loop_tick(loop, now, period, &reading, &wrench, 1) != PALPATE_OK || faulty;
        }
        const std::chrono::duration<double, std::nano> took = clock::now() - begun;
        // Another program has kept the processor for a tenth of a second: this pass does not count.
        if (faulty && palpate_loop_reset(loop) == PALPATE_OK) {
            continue;
        }
        shortest = std::min(shortest, took.count() / static_cast<double>(ticks));
    }
    return shortest;
}

}  // namespace

int main(int count, char **arguments) {
    if (count != 4) {
        std::cerr << "usage: tick_from_c SCENE POSITIONS PASSES\n";
        return 2;
    }
    std::ifstream file(arguments[2], std::ios::binary | std::ios::ate);
    std::vector<double> positions(static_cast<std::size_t>(file.tellg()) / sizeof(double));
    file.seekg(0);
    file.read(reinterpret_cast<char *>(positions.data()), static_cast<std::streamsize>(positions.size() * sizeof(double)));
    palpate_scene *scene = nullptr;
    palpate_loop *loop = nullptr;
    double nanoseconds = -1.0;
    if (file && done(palpate_scene_load(arguments[1], &scene)) && done(palpate_loop_new(scene, &loop))) {
        nanoseconds = measure(loop, positions, std::atoi(arguments[3]));
    }
    palpate_loop_free(loop);
    palpate_scene_free(scene);
    if (nanoseconds < 0.0 || nanoseconds == std::numeric_limits<double>::infinity()) {
        std::cerr << "tick_from_c: no pass was without a fault\n";
        return 2;
    }
    std::printf("%.17g\n", nanoseconds);
    return 0;
}
