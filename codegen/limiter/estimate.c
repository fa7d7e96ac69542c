/* What corrects a state that may be wrong. limiter.c includes this for a device that remembers, sample by sample;
 * ctrlgen/controller/estimate.py is its twin. */

/* The displacement becomes that which balances the states. */
static void rebalance(limiter_state *state, const real drive[NU])
{
    int k;
    (void)drive;
    for (k = 0; k < SETTLING_SWEEPS; k++) {
        BALANCE(state, state->x, state->z, drive, state->z);
    }
}

/* The answer to what leaves the state as it is. */
static uint32_t is_unsure(const limiter_state *state)
{
    return (state->unsure != 0U) ? LIMITER_UNSURE : 0U;
}

/* 1 if the state can be corrected; one that is lost stays so. */
static int can_be_corrected(limiter_state *state)
{
    if ((state->ready != LIMITER_BUILD) || (is_lost(state) != 0)) {
        state->ready = 0U;
    }
    return (state->ready != 0U) ? 1 : 0;
}

uint32_t limiter_forget(limiter_state *state)
{
    static const real START[NX] = START_TABLE; /* SI */
    uint32_t status = LIMITER_INPUT;
    if (state == NULL) {
        /* nothing is written */
    } else if (state->ready != LIMITER_BUILD) {
        status = LIMITER_LOST;
    } else {
        int i;
#if VARIED
        set_now(state);
#endif
        copy_states(START, state->x);
        for (i = 0; i < N; i++) {
            state->z[i] = REAL(0.0);
        }
        rebalance(state, U_SAFE);
        state->unsure = UNKNOWN_TICKS;
        status = LIMITER_UNSURE;
    }
    return status;
}

uint32_t limiter_elapsed(limiter_state *state, uint32_t ticks, const real drive[NU])
{
    uint32_t status = LIMITER_INPUT;
    if ((state == NULL) || (drive == NULL)) {
        /* nothing is written */
    } else if (can_be_corrected(state) == 0) {
        status = LIMITER_LOST;
    } else if (DRIVE_INSIDE(state, drive) != 0) {
        uint32_t left = ticks;
        int k;
#if VARIED
        set_now(state);
#endif
        for (k = 0; k < EXACT_TICKS; k++) {
            if (left > 0U) {
                STEP_ADVANCE(state, state->z, drive, state->x);
#if REMEMBERING
                BALANCE(state, state->x, state->z, drive, state->z);
#endif
                left -= 1U;
            }
        }
        if (left > 0U) { /* in the time that is left the device comes to rest, from wherever it was */
            for (k = 0; k < SETTLING_SWEEPS; k++) {
                SETTLE_ADVANCE(state, state->z, drive, state->x);
#if REMEMBERING
                BALANCE(state, state->x, state->z, drive, state->z);
#endif
            }
            if (state->unsure < LIMITER_SETTLING) {
                state->unsure = LIMITER_SETTLING;
            }
        }
#if !REMEMBERING
        left = ticks;
        for (k = 0; k < SETTLING_SWEEPS; k++) { /* no state remembers where the stage was in between */
            if (left > 0U) {
                BALANCE(state, state->x, state->z, drive, state->z);
                left -= 1U;
            }
        }
#endif
        if (state->unsure == LIMITER_FOREVER) {
            /* no time makes it known */
        } else if (state->unsure > ticks) {
            state->unsure -= ticks;
        } else {
            state->unsure = 0U;
        }
#if RATED
        for (k = 0; k < NU; k++) {
            state->u[k] = drive[k];
        }
#endif
        state->tick += ticks; /* told, and not to be made up for again */
        status = is_unsure(state);
    } else {
        status = LIMITER_INPUT; /* no drive that was held */
    }
    return status;
}
#if NS

static const real REACH_LOW[NS] = REACH_LOW_TABLE; /* SI: what drives can lead to */
static const real REACH_HIGH[NS] = REACH_HIGH_TABLE;

/* 1 if measured is no number, or farther than error beyond what drives can lead to. */
static int cannot_be(const real measured[NS], real error)
{
    int cannot = 0;
    int i;
    if ((is_nan(&error) != 0) || (error < REAL(0.0)) || (error > UNLIMITED)) {
        cannot = 1;
    }
    for (i = 0; i < NS; i++) {
        if ((is_nan(&measured[i]) != 0) || (measured[i] < (REACH_LOW[i] - error)) || (measured[i] > (REACH_HIGH[i] + error))) {
            cannot = 1;
        }
    }
    return cannot;
}

/* 1 if state and measured contradict one another. */
static int is_apart(const limiter_state *state, const real measured[NS], real error)
{
    static const real NEAR[NS] = KNOWN_STATE_TABLE; /* SI */
    int apart = 0;
    int i;
    for (i = 0; i < NS; i++) {
        const real by = measured[i] - state->x[i];
        if ((by > (error + NEAR[i])) || (by < -(error + NEAR[i]))) {
            apart = 1;
        }
    }
    return apart;
}

/* The states of actuators become those that were measured, at the end of their error that is farther from rest. */
static void believe(limiter_state *state, const real measured[NS], real error)
{
    static const real SIDE[NS] = SIDE_TABLE; /* of rest on which drives lead: 1 above, -1 below, 0 both */
    int i;
    for (i = 0; i < NS; i++) {
        const real most = measured[i] + (SIDE[i] * error);
        const real raised = (most > REACH_LOW[i]) ? most : REACH_LOW[i];
        state->x[i] = (raised < REACH_HIGH[i]) ? raised : REACH_HIGH[i];
    }
    rebalance(state, U_SAFE);
}

/* The samples in which an error of the states dies out. */
static uint32_t samples_of(real error)
{
    real left = error * GROWTH; /* of an estimate at one end of it */
    uint32_t samples = 0U;
    int k;
    for (k = 0; k < DOUBLED; k++) {
        if ((left > REAL(1.0)) && (samples < UNKNOWN_TICKS)) {
            left = left * REAL(0.5);
            samples += HALVING_TICKS;
        }
    }
    return (samples < UNKNOWN_TICKS) ? samples : UNKNOWN_TICKS;
}

uint32_t limiter_observe(limiter_state *state, const real measured[NS], real error)
{
    uint32_t status = LIMITER_INPUT;
    if ((state == NULL) || (measured == NULL)) {
        /* nothing is written */
    } else if (can_be_corrected(state) == 0) {
        status = LIMITER_LOST;
    } else if (cannot_be(measured, error) == 0) {
        const uint32_t told = samples_of(error);
#if VARIED
        set_now(state);
#endif
        if (state->unsure > told) {
            believe(state, measured, error);
#if NX == NS
            state->unsure = told;
#endif
        } else if ((state->unsure == 0U) && (is_apart(state, measured, error) != 0)) { /* neither is known */
            believe(state, measured, error);
            state->unsure = UNKNOWN_TICKS;
        } else {
            /* what is believed is known better */
        }
        status = is_unsure(state);
    } else {
        status = LIMITER_INPUT; /* no state that can be */
    }
    return status;
}
#endif
