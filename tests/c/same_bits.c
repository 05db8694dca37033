/*
 * Plays positions through a packed scene: by palpate_scene_run, and tick by tick. Argument: the scene, a file of positions
 * (ticks x tools x 3 doubles), how many tools, a file for the forces of both (the script's, then those of the ticks).
 */
#include <palpate.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static int refused(const char *what) {
    fprintf(stderr, "same_bits: %s: %s\n", what, palpate_last_error());
    return 2;
}

static double *read_all(const char *path, size_t *count) {
    FILE *file = fopen(path, "rb");
    double *numbers = NULL;
    if (file != NULL && fseek(file, 0, SEEK_END) == 0) {
        long bytes = ftell(file);
        numbers = malloc((size_t)bytes);
        *count = (size_t)bytes / sizeof *numbers;
        if (fseek(file, 0, SEEK_SET) != 0 || fread(numbers, sizeof *numbers, *count, file) != *count) {
            free(numbers);
            numbers = NULL;
        }
    }
    if (file != NULL) {
        fclose(file);
    }
    return numbers;
}

/* Readings as a script makes them: velocities are mean ones, and a tool's orientation stays. */
static int tick_all(palpate_loop *loop, const double *positions, size_t ticks, size_t tools, double *forces) {
    const double period = 1e-3;
    palpate_reading readings[PALPATE_MAX_TOOLS];
    palpate_wrench wrenches[PALPATE_MAX_TOOLS];
    memset(readings, 0, sizeof readings);
    for (size_t tick = 0; tick < ticks; tick++) {
        for (size_t tool = 0; tool < tools; tool++) {
            palpate_reading *reading = &readings[tool];
            const double *position = positions + 3 * (tick * tools + tool);
            for (int axis = 0; axis < 3; axis++) {
                reading->velocity[axis] = tick == 0 ? 0.0 : (position[axis] - reading->position[axis]) / period;
                reading->position[axis] = position[axis];
            }
            reading->active = 1;
        }
        if (palpate_loop_tick(loop, 1000000 * tick, period, readings, wrenches, tools) != PALPATE_OK) {
            return refused("palpate_loop_tick");
        }
        for (size_t tool = 0; tool < tools; tool++) {
            memcpy(forces + 3 * (tick * tools + tool), wrenches[tool].force, sizeof wrenches[tool].force);
        }
    }
    return 0;
}

static int play(palpate_scene *scene, const double *positions, size_t ticks, size_t tools, double *forces) {
    palpate_loop *loop = NULL;
    if (palpate_scene_run(scene, ticks, tools, positions, NULL, forces, NULL) != PALPATE_OK) {
        return refused("palpate_scene_run");
    }
    if (palpate_loop_new(scene, &loop) != PALPATE_OK) {
        return refused("palpate_loop_new");
    }
    int code = tick_all(loop, positions, ticks, tools, forces + 3 * ticks * tools);
    palpate_loop_free(loop);
    return code;
}

int main(int count, char **arguments) {
    if (count != 5) {
        fprintf(stderr, "usage: same_bits SCENE POSITIONS TOOLS FORCES\n");
        return 2;
    }
    size_t numbers = 0, tools = (size_t)atoi(arguments[3]);
    double *positions = read_all(arguments[2], &numbers), *forces = calloc(2 * numbers + 1, sizeof *forces);
    palpate_scene *scene = NULL;
    FILE *out = fopen(arguments[4], "wb");
    int code = 2;
    if (positions != NULL && forces != NULL && out != NULL && tools > 0 && tools <= PALPATE_MAX_TOOLS) {
        if (palpate_scene_load(arguments[1], &scene) != PALPATE_OK) {
            code = refused("palpate_scene_load");
        } else {
            code = play(scene, positions, numbers / (3 * tools), tools, forces);
        }
        if (code == 0 && fwrite(forces, sizeof *forces, 2 * numbers, out) != 2 * numbers) {
            code = 2;
        }
    }
    if (out != NULL) {
        fclose(out);
    }
    palpate_scene_free(scene);
    free(positions);
    free(forces);
    return code;
}
