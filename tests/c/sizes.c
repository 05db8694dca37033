/*
 * Uses every struct that may grow, with bytes behind each of them that are not the library's, and prints the force of a
 * press. Compiled against the header of the first interface (abi-1.0/palpate.h). Argument: a store.
 */
#include <palpate.h>
#include <stdio.h>
#include <string.h>

#define BEHIND 64
#define GUARDED(type) \
    struct { \
        type own; \
        unsigned char behind[BEHIND]; \
    }
#define SET(guarded) memset(&(guarded), 0xa5, sizeof(guarded))

static int untouched(const unsigned char *behind, const char *name) {
    for (int i = 0; i < BEHIND; i++) {
        if (behind[i] != 0xa5) {
            fprintf(stderr, "sizes: %s was written beyond its end\n", name);
            return 0;
        }
    }
    return 1;
}

static int done(palpate_status status, const char *what) {
    if (status != PALPATE_OK) {
        fprintf(stderr, "sizes: %s: %s\n", what, palpate_last_error());
    }
    return status == PALPATE_OK;
}

static int press(palpate_loop *loop, double height) {
    GUARDED(palpate_frame) frame;
    palpate_reading reading = {{0.04, 0.025, height}, {0, 0, 0, 0}, {0, 0, 0}, {0, 0, 0}, 0, 0, 1};
    palpate_wrench wrench;
    SET(frame);
    for (uint64_t tick = 0; tick < 2000; tick++) {
        if (!done(palpate_loop_tick(loop, 1000000 * tick, 1e-3, &reading, &wrench, 1), "tick")) {
            return 0;
        }
    }
    frame.own.struct_size = sizeof frame.own;
    if (!done(palpate_loop_get_frame(loop, &frame.own), "frame") || !untouched(frame.behind, "palpate_frame")) {
        return 0;
    }
    printf("%u %llu %.17g %.17g\n", frame.own.struct_size, (unsigned long long)frame.own.ticks, wrench.force[2],
           frame.own.forces[0][2]);
    frame.own.struct_size = sizeof frame.own + 1024;
    if (palpate_loop_get_frame(loop, &frame.own) == PALPATE_OK || strstr(palpate_last_error(), "newer") == NULL) {
        fprintf(stderr, "sizes: a newer struct was not refused: %s\n", palpate_last_error());
        return 0;
    }
    return 1;
}

static int play(const char *file) {
    GUARDED(palpate_store_info) info;
    GUARDED(palpate_body_options) body;
    GUARDED(palpate_tool_options) tool;
    GUARDED(palpate_device_limits) limits;
    GUARDED(palpate_scene_options) options;
    palpate_store *store = NULL;
    palpate_scene *scene = NULL;
    palpate_loop *loop = NULL;
    uint32_t handle;
    SET(info), SET(body), SET(tool), SET(limits), SET(options);
    info.own.struct_size = sizeof info.own;
    options.own.struct_size = sizeof options.own;
    int fine = done(palpate_store_load(file, &store), "load") && done(palpate_store_get_info(store, &info.own), "info") &&
               done(palpate_scene_new(&scene), "scene") &&
               done(palpate_body_options_init(&body.own, sizeof body.own), "body options") &&
               done(palpate_tool_options_init(&tool.own, sizeof tool.own), "tool options") &&
               done(palpate_device_limits_init(&limits.own, sizeof limits.own), "limits") &&
               done(palpate_device_limits_known("Touch", &limits.own, sizeof limits.own), "known limits") &&
               done(palpate_scene_get_options(scene, &options.own), "scene options");
    if (fine) {
        options.own.strain_limit = 0.0;
        options.own.ramp = 0.0;
        tool.own.radius = 0.006;
        tool.own.max_stiffness = 300.0;
        fine = done(palpate_scene_set_options(scene, &options.own), "set options") &&
               done(palpate_scene_add_body(scene, store, &body.own, &handle), "add body") &&
               done(palpate_scene_add_tool(scene, &tool.own, &handle), "add tool") &&
               done(palpate_scene_set_device(scene, handle, &limits.own), "set device") &&
               done(palpate_loop_new(scene, &loop), "loop");
    }
    fine = fine && untouched(info.behind, "palpate_store_info") && untouched(body.behind, "palpate_body_options") &&
           untouched(tool.behind, "palpate_tool_options") && untouched(limits.behind, "palpate_device_limits") &&
           untouched(options.behind, "palpate_scene_options") && press(loop, info.own.highest[2] + 0.004);
    palpate_loop_free(loop);
    palpate_scene_free(scene);
    palpate_store_free(store);
    return fine;
}

int main(int argc, char **argv) {
    return argc == 2 && play(argv[1]) ? 0 : 2;
}
