/* Poses of a pivot, another point of the body than the one that a target states. limiter.c includes this where a target can turn about one. */

uint32_t limiter_about(const real pivot[3], const real pose[M], real target[M])
{
    uint32_t status = LIMITER_INPUT;
    if ((pivot != NULL) && (pose != NULL) && (target != NULL)) {
        if (can_turn(pose, pivot) != 0) {
            OF_PIVOT(pose, pivot, target);
            status = 0U;
        }
    }
    return status;
}
