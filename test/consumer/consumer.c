/* A small muscle made and moved by a program outside this project. */
#include <sph_muscle/io.h>

#include <stdio.h>

int main(void) {
    sphm_context context = {0};
    sphm_parameters parameters = sphm_parameters_default();
    sphm_muscle *muscle = NULL;
    sphm_status status = sphm_parameters_set(&parameters, "particles", "300", &context);
    if (status == SPHM_OK)
        status = sphm_io_create_muscle(&parameters, &muscle, &context);
    if (status == SPHM_OK)
        status = sphm_muscle_advance(muscle, 0.01, &context);
    if (status != SPHM_OK)
        fprintf(stderr, "%s\n", context.message);
    printf("sph_muscle %s, t = %g s\n", sphm_version(), muscle != NULL ? sphm_muscle_time(muscle) : 0);
    sphm_muscle_destroy(muscle);
    return status == SPHM_OK ? 0 : 1;
}
