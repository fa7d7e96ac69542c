/* A step at a tick of a clock. limiter.c includes this where a state can be wrong; ctrlgen/controller/clocked.py is its twin. */

/* The answer where no sample has passed: state and out stay as they are. An out without drives that can have been held is not that of the
 * last call, and no drive for the hardware. */
static uint32_t wait_for_sample(limiter_state *state, limiter_output *out)
{
    uint32_t status;
    if (DRIVE_INSIDE(state, out->drive) != 0) {
#if RINGING
        status = is_ringing(state, REAL(0.0));
#else
        status = is_unsure(state);
#endif
    } else {
#if RATED
        int i;
#endif
        set_safe(out);
#if RATED
        for (i = 0; i < NU; i++) { /* the drive that was held */
            out->drive[i] = state->u[i];
        }
        (void)limit_all(out->drive, U_LOW, U_HIGH, U_SLACK, NU);
#endif
        status = limiter_forget(state);
    }
    return status;
}

uint32_t limiter_step_at(limiter_state *state, uint32_t tick, const real target[M], limiter_output *out)
{
    uint32_t status = 0U;
    uint32_t since = 1U;
    if ((state != NULL) && (out != NULL) && (state->ready == LIMITER_BUILD)) {
        since = (state->ticking != 0U) ? (tick - state->tick) : 1U;
#if VARIED
        if (state->ticking == UNCOUNTED) {
            since = BACKWARD;
        }
#endif
        if (since != 1U) {
            status = LIMITER_CLOCK;
        }
        if ((since > 1U) && ((since >= BACKWARD) || (limiter_elapsed(state, since - 1U, out->drive) == LIMITER_INPUT))) {
            (void)limiter_forget(state);
        }
        state->ticking = 1U;
        if (since != 0U) {
            state->tick = tick - 1U; /* and one more, as every sample */
        }
    }
    if (since != 0U) {
        status |= limiter_step(state, target, out);
    } else {
        status |= wait_for_sample(state, out);
    }
    return status;
}
