/* Whether the state may be wrong, sample by sample. limiter.c includes this for a device that remembers. */

/* A sample: the clock of step_at goes on by one; UNSURE while the state may be wrong, a sample less of it then. */
static uint32_t count_down(limiter_state *state)
{
    uint32_t status = 0U;
    state->tick += 1U;
    if (state->unsure != 0U) {
        status = LIMITER_UNSURE;
        if (state->unsure != LIMITER_FOREVER) {
            state->unsure -= 1U;
        }
    }
    return status;
}

static void copy_states(const real from[NX], real to[NX])
{
    int i;
    for (i = 0; i < NX; i++) {
        to[i] = from[i];
    }
}

/* After settling the device is on its way there, unless it was there before. */
static void mark_moved(limiter_state *state, const real before[NX])
{
    static const real KNOWN[NX] = KNOWN_TABLE; /* SI */
    int moved = 0;
    int i;
    for (i = 0; i < NX; i++) {
        const real by = state->x[i] - before[i];
        if ((by > KNOWN[i]) || (by < -KNOWN[i])) {
            moved = 1;
        }
    }
    if ((moved != 0) && (state->unsure < LIMITER_SETTLING)) {
        state->unsure = LIMITER_SETTLING;
    }
}
