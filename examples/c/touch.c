/*
 * Presses a precomputed body once and prints the force: no loop, no threads.
 *
 *   cc touch.c $(pkg-config --cflags --libs palpate) -lm -o touch
 *   ./touch liver.palpate 3        (3 mm, at its highest point)
 */
#include <math.h>
#include <palpate.h>
#include <stdio.h>
#include <stdlib.h>

/* One line and exit code 2, as the command line of Palpate has it. */
static int refused(const char *what) {
    fprintf(stderr, "touch: %s: %s\n", what, palpate_last_error());
    return 2;
}

/* Surface node with the largest z. */
static size_t highest(const double *positions, size_t nodes) {
    size_t best = 0;
    for (size_t node = 1; node < nodes; node++) {
        if (positions[3 * node + 2] > positions[3 * best + 2]) {
            best = node;
        }
    }
    return best;
}

static int press(const palpate_store *store, double depth) {
    palpate_store_info info = {0};
    info.struct_size = sizeof info;
    if (palpate_store_get_info(store, &info) != PALPATE_OK) {
        return refused("palpate_store_get_info");
    }
    size_t nodes = info.nodes;
    double *positions = malloc(3 * nodes * sizeof *positions);
    double *displacements = malloc(3 * nodes * sizeof *displacements);
    int code = 1;
    if (positions != NULL && displacements != NULL) {
        double longest = 0.0, force[3], error = 0.0;
        for (int axis = 0; axis < 3; axis++) {
            longest = fmax(longest, info.highest[axis] - info.lowest[axis]);
        }
        /* A patch of a sixteenth of the body; NAN leaves a component free. */
        const double radius = longest / 16.0, displacement[3] = {NAN, NAN, -depth};
        if (palpate_store_get_positions(store, positions, nodes) != PALPATE_OK) {
            code = refused("palpate_store_get_positions");
        } else {
            const double *point = positions + 3 * highest(positions, nodes);
            if (palpate_store_touch(store, point, displacement, radius, force, displacements, nodes, &error) !=
                PALPATE_OK) {
                code = refused("palpate_store_touch");
            } else {
                printf("pressed %.3g mm at (%.4f, %.4f, %.4f) m, patch of %.3g mm\n", 1e3 * depth, point[0], point[1],
                       point[2], 1e3 * radius);
                printf("force on the body: %.17g %.17g %.17g N, right to %.2g %%\n", force[0], force[1], force[2],
                       100.0 * error);
                code = 0;
            }
        }
    }
    free(positions);
    free(displacements);
    return code;
}

int main(int count, char **arguments) {
    if (count < 2) {
        fprintf(stderr, "usage: touch STORE [MILLIMETRES]\n");
        return 2;
    }
    if (palpate_abi_version() >> 16 != PALPATE_ABI_MAJOR) {
        fprintf(stderr, "touch: libpalpate is of another interface than palpate.h\n");
        return 2;
    }
    palpate_store *store = NULL;
    if (palpate_store_load(arguments[1], &store) != PALPATE_OK) {
        return refused("palpate_store_load");
    }
    int code = press(store, 1e-3 * (count > 2 ? atof(arguments[2]) : 1.0));
    palpate_store_free(store);
    return code;
}
