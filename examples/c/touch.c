/*
 * Presses a precomputed body once and prints the force: no loop, no threads.
 *
 *   cc touch.c $(pkg-config --cflags --libs palpate) -lm -o touch
 *   ./touch liver.palpate 3        (3 mm, from above its middle)
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

static int press(const palpate_store *store, double depth) {
    palpate_store_info info = {0};
    info.struct_size = sizeof info;
    if (palpate_store_get_info(store, &info) != PALPATE_OK) {
        return refused("palpate_store_get_info");
    }
    double longest = 0.0, point[3], force[3], error = 0.0, largest = 0.0;
    for (int axis = 0; axis < 3; axis++) {
        longest = fmax(longest, info.highest[axis] - info.lowest[axis]);
        point[axis] = 0.5 * (info.lowest[axis] + info.highest[axis]);
    }
    /* From above the middle: the closest point of the surface is pressed. */
    point[2] = info.highest[2];
    /* A patch of a sixteenth of the body; NAN leaves a component free. */
    const double radius = longest / 16.0, displacement[3] = {NAN, NAN, -depth};
    double *displacements = malloc(3 * (size_t)info.nodes * sizeof *displacements);
    if (displacements == NULL) {
        return 1;
    }
    palpate_status status =
        palpate_store_touch(store, point, displacement, radius, force, displacements, info.nodes, &error);
    for (size_t i = 0; status == PALPATE_OK && i < 3 * (size_t)info.nodes; i += 3) {
        largest = fmax(largest, hypot(hypot(displacements[i], displacements[i + 1]), displacements[i + 2]));
    }
    free(displacements);
    if (status != PALPATE_OK) {
        return refused("palpate_store_touch");
    }
    printf("pressed %.3g mm near (%.4f, %.4f, %.4f) m, by a patch of %.3g mm\n", 1e3 * depth, point[0], point[1], point[2],
           1e3 * radius);
    printf("force on the body: %.17g %.17g %.17g N, right to %.2g %%\n", force[0], force[1], force[2], 100.0 * error);
    printf("largest displacement: %.4g mm\n", 1e3 * largest);
    return 0;
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
