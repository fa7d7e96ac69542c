/* Samples whose times vary. limiter.c includes this for a device whose states are stepped exactly over any time;
 * ctrlgen/controller/timed.py is its twin. */

/* 1 if a time is a number within its bounds. */
static int is_time(real h)
{
    return (TIME_WITHIN) ? 1 : 0;
}

/* The state becomes that of so long after the last step, under the drive that was held since. */
static void pass_time(limiter_state *state, real since, const real drive[NU])
{
    int i;
    (void)drive;
    state->h = since;
#if NX
    for (i = 0; i < NX; i++) {
        state->x[i] = state->x_begun[i];
    }
#endif
    for (i = 0; i < N; i++) {
        state->z[i] = state->z_begun[i];
    }
#if NX
    STEP_ADVANCE(state, state->z, drive, state->x);
#endif
    BALANCE(state, state->x, state->z, drive, state->z);
}

/* The sample that ends now was no longer than it was to be, or is known; CLOCK where the device was not where it was led. */
static uint32_t end_sample(limiter_state *state, real since, const real drive[NU], int *known)
{
    uint32_t status = 0U;
    *known = 1;
    if (state->stepping != 0U) {
        if ((is_time(since) == 0) || (DRIVE_INSIDE(state, drive) == 0)) {
            *known = 0;
            status = LIMITER_CLOCK;
        } else if ((since > state->h) || (since < state->h)) {
            status = (since > state->h) ? LIMITER_CLOCK : 0U;
            pass_time(state, since, drive);
        } else {
            /* as it was to be */
        }
    }
    return status;
}

uint32_t limiter_settle(limiter_state *state, const real target[M], limiter_output *out)
{
    if ((state != NULL) && (out != NULL) && (state->ready == LIMITER_BUILD)) {
        set_now(state);
    }
    return settle_sample(state, target, out);
}

uint32_t limiter_step(limiter_state *state, const real target[M], limiter_output *out)
{
    if ((state != NULL) && (out != NULL) && (state->ready == LIMITER_BUILD)) {
        set_begin(state, SAMPLE_TIME);
        state->stepping = 1U;
    }
    return step_sample(state, target, out);
}

uint32_t limiter_step_after(limiter_state *state, real since, real ahead, const real target[M], limiter_output *out)
{
    const real *wanted = target;
    uint32_t status = 0U;
    if ((state != NULL) && (out != NULL) && (state->ready == LIMITER_BUILD)) {
        if (is_lost(state) != 0) {
            state->ready = 0U;
        } else {
            real time = ahead;
            int known;
            status = end_sample(state, since, out->drive, &known);
            if (known == 0) {
#if ESTIMATED
                (void)limiter_forget(state);
#endif
                wanted = NULL;
            }
            if (is_time(ahead) == 0) {
                status = LIMITER_CLOCK;
                wanted = NULL;
                time = SAMPLE_TIME;
            }
            set_begin(state, time);
            state->stepping = 1U;
#if ESTIMATED
            state->ticking = UNCOUNTED;
#endif
        }
    }
    return status | step_sample(state, wanted, out);
}
