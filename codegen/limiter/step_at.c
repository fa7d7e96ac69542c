/* A step at a tick of a clock. limiter.c includes this where a state can be wrong; ctrlgen/controller/clocked.py is its twin. */

uint32_t limiter_step_at(limiter_state *state, uint32_t tick, const real target[M], limiter_output *out)
{
    uint32_t status = 0U;
    uint32_t since = 1U;
    if ((state != NULL) && (out != NULL) && (state->ready == LIMITER_BUILD)) {
        since = (state->ticking != 0U) ? (tick - state->tick) : 1U;
        state->ticking = 1U;
        state->tick = tick;
        if (since != 1U) {
            status = LIMITER_CLOCK;
        }
        if ((since > 1U) && ((since >= BACKWARD) || (limiter_elapsed(state, since - 1U, out->drive) == LIMITER_INPUT))) {
            (void)limiter_forget(state);
        }
    }
    if (since != 0U) {
        status |= limiter_step(state, target, out);
    }
    return status;
}
