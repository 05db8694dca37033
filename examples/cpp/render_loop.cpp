// A haptic loop at 1 kHz and a render loop at 60 Hz, as a program with CHAI3D or a game engine has them.
//
//   c++ -std=c++17 render_loop.cpp $(pkg-config --cflags --libs palpate) -pthread -o render_loop
//   ./render_loop liver.pack --seconds 3 --out frames.csv
//
// The haptic thread reads a device, ticks, and puts the force out: here a hand that presses and lets go by a formula. The
// render thread takes the latest tick through a wait-free hand-off, works the deformed surface out and would draw it: here it
// writes a row of a table. liver.pack is a scene that `palpate pack` has written; a bare store will do, too.
#include <palpate.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdint>
#include <cstdlib>
#include <fstream>
#include <iostream>
#include <limits>
#include <memory>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

namespace {

void require(palpate_status status) {
    if (status != PALPATE_OK) {
        throw std::runtime_error(palpate_last_error());
    }
}

struct FreeScene {
    void operator()(palpate_scene *scene) const { palpate_scene_free(scene); }
};
struct FreeLoop {
    void operator()(palpate_loop *loop) const { palpate_loop_free(loop); }
};
using Scene = std::unique_ptr<palpate_scene, FreeScene>;
using Loop = std::unique_ptr<palpate_loop, FreeLoop>;

Scene load(const std::string &path) {
    palpate_scene *scene = nullptr;
    require(palpate_scene_load(path.c_str(), &scene));
    return Scene(scene);
}

Loop loop_of(const Scene &scene) {
    palpate_loop *loop = nullptr;
    require(palpate_loop_new(scene.get(), &loop));
    return Loop(loop);
}

// What is drawn: fixed triangles, and positions that move.
struct Surface {
    std::vector<double> rest, positions;
    std::vector<std::uint32_t> triangles;

    explicit Surface(const palpate_loop *loop) {
        std::size_t nodes = 0, faces = 0;
        require(palpate_loop_get_surface_size(loop, 0, &nodes, &faces));
        rest.resize(3 * nodes);
        positions.resize(3 * nodes);
        triangles.resize(3 * faces);
        require(palpate_loop_get_rest_positions(loop, 0, rest.data(), nodes));
        require(palpate_loop_get_triangles(loop, 0, triangles.data(), faces));
    }

    void update(palpate_loop *loop) { require(palpate_loop_get_positions(loop, 0, positions.data(), rest.size() / 3)); }

    // Node at rest closest to the middle of the upper side of the box around the body, m.
    std::array<double, 3> top() const {
        std::array<double, 3> low{rest[0], rest[1], rest[2]}, high = low;
        for (std::size_t i = 0; i < rest.size(); ++i) {
            low[i % 3] = std::min(low[i % 3], rest[i]);
            high[i % 3] = std::max(high[i % 3], rest[i]);
        }
        const std::array<double, 3> goal{0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1]), high[2]};
        std::array<double, 3> best{};
        double closest = std::numeric_limits<double>::infinity();
        for (std::size_t i = 0; i < rest.size(); i += 3) {
            const double distance = std::hypot(rest[i] - goal[0], rest[i + 1] - goal[1], rest[i + 2] - goal[2]);
            if (distance < closest) {
                closest = distance;
                best = {rest[i], rest[i + 1], rest[i + 2]};
            }
        }
        return best;
    }

    double largest_displacement() const {
        double squared = 0.0;
        for (std::size_t i = 0; i < rest.size(); i += 3) {
            const double x = positions[i] - rest[i], y = positions[i + 1] - rest[i + 1], z = positions[i + 2] - rest[i + 2];
            squared = std::max(squared, x * x + y * y + z * z);
        }
        return std::sqrt(squared);
    }
};

// In place of a device: presses once a second from above, `depth` deep, and lets go.
class Hand {
public:
    Hand(std::array<double, 3> top, double clear, double depth) : top_(top), clear_(clear), depth_(depth) {}

    palpate_reading read(double time) const {
        constexpr double rate = 2.0 * 3.14159265358979323846;
        palpate_reading reading{};
        const double down = 0.5 * (1.0 - std::cos(rate * time)), speed = 0.5 * rate * std::sin(rate * time);
        reading.position[0] = top_[0];
        reading.position[1] = top_[1];
        reading.position[2] = top_[2] + clear_ - (clear_ + depth_) * down;
        reading.velocity[2] = -(clear_ + depth_) * speed;
        reading.active = 1;
        return reading;
    }

private:
    std::array<double, 3> top_;
    double clear_, depth_;
};

// The haptic thread: the body of this loop is what a device's callback would do.
void haptics(palpate_loop *loop, const Hand &hand, std::size_t tools, double rate, const std::atomic<bool> &stop) {
    const double period = 1.0 / rate;
    const auto step = std::chrono::nanoseconds(static_cast<std::int64_t>(1e9 * period));
    std::vector<palpate_reading> readings(tools, palpate_reading{});
    std::vector<palpate_wrench> wrenches(tools);
    auto due = std::chrono::steady_clock::now();
    double time = 0.0;
    while (!stop.load(std::memory_order_relaxed)) {
        readings[0] = hand.read(time);
        const palpate_status status =
            palpate_loop_tick(loop, palpate_now_ns(), period, readings.data(), wrenches.data(), tools);
        // wrenches[0].force would go out to the device here: zero in a fault, which the render loop tells of.
        if (status < 0) {
            std::cerr << "render_loop: " << palpate_last_error() << '\n';
            return;
        }
        time += period;
        due += step;
        std::this_thread::sleep_until(due);
    }
}

struct Options {
    std::string scene, out = "frames.csv";
    double seconds = 3.0, rate = 1000.0;
};

Options parse(int count, char **arguments) {
    Options options;
    for (int i = 1; i < count; ++i) {
        const std::string name = arguments[i];
        const bool has_value = i + 1 < count;
        if (name == "--seconds" && has_value) {
            options.seconds = std::atof(arguments[++i]);
        } else if (name == "--rate" && has_value) {
            options.rate = std::atof(arguments[++i]);
        } else if (name == "--out" && has_value) {
            options.out = arguments[++i];
        } else if (options.scene.empty() && name[0] != '-') {
            options.scene = name;
        } else {
            throw std::runtime_error("usage: render_loop SCENE [--seconds S] [--out TABLE] [--rate HZ]");
        }
    }
    if (options.scene.empty() || options.rate <= 0.0) {
        throw std::runtime_error("usage: render_loop SCENE [--seconds S] [--out TABLE] [--rate HZ]");
    }
    return options;
}

// Runs both loops; the largest force that was seen, N.
double run(const Options &options) {
    const Scene scene = load(options.scene);
    std::size_t tools = 0;
    require(palpate_scene_get_counts(scene.get(), nullptr, &tools));
    const Loop loop = loop_of(scene);
    require(palpate_loop_check_period(loop.get(), 1.0 / options.rate));
    Surface surface(loop.get());
    // A ball reaches down to its radius below the tip: clear by 2 cm, then 1 mm of the tip below the surface.
    const Hand hand(surface.top(), 0.02, 0.001);
    std::atomic<bool> stop{false};
    std::thread haptic(haptics, loop.get(), std::cref(hand), tools, options.rate, std::cref(stop));
    std::ofstream table(options.out);
    table << "time_s,tip_z_m,force_x_N,force_y_N,force_z_N,contacts,largest_displacement_m,ticks\n";
    double largest = 0.0;
    const auto begin = std::chrono::steady_clock::now();
    const auto frames = static_cast<std::int64_t>(60.0 * options.seconds);
    try {
        for (std::int64_t i = 1; i <= frames; ++i) {
            std::this_thread::sleep_until(begin + i * std::chrono::microseconds(16667));
            palpate_frame frame{};
            frame.struct_size = sizeof frame;
            require(palpate_loop_get_frame(loop.get(), &frame));
            surface.update(loop.get());
            const auto &force = frame.forces[0];
            largest = std::max(largest, std::sqrt(force[0] * force[0] + force[1] * force[1] + force[2] * force[2]));
            table << frame.time << ',' << frame.positions[0][2] << ',' << force[0] << ',' << force[1] << ',' << force[2]
                  << ',' << frame.contacts << ',' << surface.largest_displacement() << ',' << frame.ticks << '\n';
            if (frame.faulty != 0) {
                std::cerr << "render_loop: " << frame.fault << '\n';
                require(palpate_loop_reset(loop.get()));
            }
        }
    } catch (...) {
        stop = true;
        haptic.join();
        throw;
    }
    stop = true;
    haptic.join();
    palpate_frame last{};
    last.struct_size = sizeof last;
    require(palpate_loop_get_frame(loop.get(), &last));
    std::printf("%llu ticks, half of them within %.1f us, 99.9 %% within %.1f us; largest force %.4g N; %s\n",
                static_cast<unsigned long long>(last.ticks), last.compute_us.p50, last.compute_us.p999, largest,
                options.out.c_str());
    return largest;
}

}  // namespace

int main(int count, char **arguments) {
    try {
        return run(parse(count, arguments)) > 0.0 ? 0 : 1;
    } catch (const std::exception &error) {
        std::cerr << "render_loop: " << error.what() << '\n';
        return 2;
    }
}
