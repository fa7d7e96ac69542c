/* What corrects how far the device may be off its motion. limiter.c includes this for a device with inertia;
 * ctrlgen/controller/motion_estimate.py is its twin. */

/* Nothing is known of the device but that its drives were within their limits. */
static void set_unknown(limiter_state *state)
{
    static const real HOME[NX] = REST_TABLE; /* SI */
    int i;
    for (i = 0; i < NX; i++) {
        state->x[i] = HOME[i];
    }
    for (i = 0; i < N; i++) {
        state->z[i] = REAL(0.0);
    }
    set_still(state, state->ahead);
    state->ringing = UNKNOWN_RINGING;
}

uint32_t limiter_forget(limiter_state *state)
{
    uint32_t status = LIMITER_INPUT;
    if (state == NULL) {
        /* nothing is written */
    } else if (state->ready != LIMITER_BUILD) {
        status = LIMITER_LOST;
    } else {
        set_unknown(state);
        status = LIMITER_UNSURE;
    }
    return status;
}

/* 1 if the state can be corrected; one that is lost stays so. */
static int can_be_corrected(limiter_state *state)
{
    if ((state->ready != LIMITER_BUILD) || (is_lost(state) != 0)) {
        state->ready = 0U;
    }
    return (state->ready != 0U) ? 1 : 0;
}

/* What is left of a ringing after so many samples: DECAY to their power, by squares. */
static real left_after(real ringing, uint32_t ticks)
{
    real left = ringing;
    real power = DECAY;
    uint32_t rest = ticks;
    int k;
    for (k = 0; k < 32; k++) {
        if ((rest & 1U) != 0U) {
            left = left * power;
        }
        power = power * power;
        rest >>= 1U;
    }
    return left;
}

uint32_t limiter_elapsed(limiter_state *state, uint32_t ticks, const real drive[NU])
{
    uint32_t status = LIMITER_INPUT;
    if ((state == NULL) || (drive == NULL)) {
        /* nothing is written */
    } else if (can_be_corrected(state) == 0) {
        status = LIMITER_LOST;
    } else if (DRIVE_INSIDE(state, drive) != 0) {
#if RATED
        int i;
#endif
        if (ticks > 0U) { /* it rings about the equilibrium under this drive */
            int k;
            for (k = 0; k < SETTLING_SWEEPS; k++) {
                SETTLE_ADVANCE(state, state->z, drive, state->x);
                BALANCE(state, state->x, state->z, drive, state->z);
            }
            if (is_lost(state) != 0) { /* far beyond its range */
                set_unknown(state);
            } else {
                real still[NY];
                set_still(state, still);
                state->ringing = bounded(state->ringing + added(state, still, REAL(0.0)), still);
                state->ringing = bounded(left_after(state->ringing, ticks), still);
                for (k = 0; k < NY; k++) {
                    state->ahead[k] = still[k];
                }
            }
        }
#if RATED
        for (i = 0; i < NU; i++) {
            state->u[i] = drive[i];
        }
#endif
        state->tick += ticks; /* told, and not to be made up for again */
        status = is_ringing(state, REAL(0.0));
    } else {
        status = LIMITER_INPUT; /* no drive that was held */
    }
    return status;
}
#if OBSERVED

/* 1 if an error is one: a number of zero or more that is not absurd. */
static int is_error(const real error[], int count)
{
    int is = 1;
    int i;
    for (i = 0; i < count; i++) {
        if ((is_nan(&error[i]) != 0) || (error[i] < REAL(0.0)) || (error[i] > UNLIMITED)) {
            is = 0;
        }
    }
    return is;
}

uint32_t limiter_observe(limiter_state *state, const real x[NX], const real z[N], const real x_error[NX], const real z_error[N])
{
    static const real REACH[NY] = REACH_TABLE; /* of what is told */
    uint32_t status = LIMITER_INPUT;
    if ((state == NULL) || (x == NULL) || (z == NULL) || (x_error == NULL) || (z_error == NULL)) {
        /* nothing is written */
    } else if (can_be_corrected(state) == 0) {
        status = LIMITER_LOST;
    } else {
        limiter_state seen;
        limiter_state off;
        int i;
        seen = *state;
        off = *state;
        for (i = 0; i < NX; i++) {
            seen.x[i] = x[i];
            off.x[i] = x_error[i];
        }
        for (i = 0; i < N; i++) {
            seen.z[i] = z[i];
            off.z[i] = z_error[i];
        }
        if ((is_lost(&seen) == 0) && (is_error(x_error, NX) != 0) && (is_error(z_error, N) != 0)) {
            real measured[NY];
            real error[NY];
            real size = REAL(0.0);
            int apart = 0;
            set_still(&seen, measured);
            set_still(&off, error);
            for (i = 0; i < NY; i++) {
                const real away = magnitude(measured[i] - state->ahead[i]);
                size += away + error[i];
                if (away > (error[i] + (REACH[i] * (state->ringing + REAL(1.0))))) {
                    apart = 1;
                }
            }
            if ((apart != 0) || (size < state->ringing)) {
                state->ringing = size;
            }
            status = is_ringing(state, REAL(0.0));
        }
    }
    return status;
}
#endif
