/* Targets with derivatives by time: the drives of a motion. limiter.c includes this for a device with inertia. */

/* 1 if every one of count values is within its limits or beyond by no more than the slack; 0 for NaN. */
static int all_within(const real value[], const real low[], const real high[], const real slack[], int count)
{
    int within = 1;
    int i;
    for (i = 0; i < count; i++) {
        if ((is_nan(&value[i]) != 0) || (value[i] > (high[i] + slack[i])) || (value[i] < (low[i] - slack[i]))) {
            within = 0;
        }
    }
    return within;
}

/* The limits that a motion breaks beside those of the drives, as a status; 0 for none. */
static uint32_t motion_broken(const limiter_state *at)
{
    static const real LOW[N] = Z_LOW_TABLE; /* m */
    static const real HIGH[N] = Z_HIGH_TABLE; /* m */
    static const real SLACK[N] = Z_SLACK_TABLE; /* m */
    uint32_t status = 0U;
    if (all_within(at->z, LOW, HIGH, SLACK, N) == 0) {
        status = LIMITER_DISPLACEMENT;
    }
#if SHARES
    if (status == 0U) {
        real share[SHARES];
        int i;
        COMPOSITE_SHARES(at, at->z, share);
        for (i = 0; i < SHARES; i++) {
            if ((is_nan(&share[i]) != 0) || (share[i] > COMPOSITE_SLACK_SQUARED)) {
                status = LIMITER_COMPOSITE;
            }
        }
    }
#endif
#if STATE_LIMITED
    {
        static const real STATE_LEAST[NS] = S_LOW_TABLE; /* SI */
        static const real STATE_MOST[NS] = S_HIGH_TABLE;
        static const real STATE_SLACK[NS] = S_SLACK_TABLE;
        if (all_within(at->x, STATE_LEAST, STATE_MOST, STATE_SLACK, NS) == 0) {
            status |= LIMITER_STATE;
        }
    }
#endif
    return status;
}

/* The drives of the motion whose state is at, within their limits. */
static uint32_t motion_drives(limiter_state *at, const limiter_state *state, const real target[M], limiter_output *out)
{
#if RINGING
    static const real U_WEIGHT[NU] = U_WEIGHT_TABLE;
    real left = REAL(0.0);
    real wanted[NU];
    real join[2 * NY];
#endif
    uint32_t status = 0U;
    int i;
#if RATED
    real share = REAL(1.0);
#endif
    (void)state;
#if RINGING
    MOTION_JOINS(target, join); /* before out, which may be the target */
#endif
    MOTION_DRIVE(target, out->drive);
#if REDUNDANT
    choose_drives(state, out->drive);
#endif
#if RINGING
    for (i = 0; i < NU; i++) {
        wanted[i] = out->drive[i];
    }
#endif
    if (limit_all(out->drive, U_LOW, U_HIGH, U_SLACK, NU) != 0) {
        status = LIMITER_DRIVE;
    }
#if RATED
    if (limit_rate(state, out->drive, &share) > 1) {
        status |= LIMITER_RATE;
    }
    for (i = 0; i < NU; i++) {
        at->u[i] = out->drive[i];
    }
#endif
    for (i = 0; i < N; i++) {
        out->displacement[i] = at->z[i];
    }
#if NS
    for (i = 0; i < NS; i++) {
        out->state[i] = at->x[i];
    }
#endif
#if RINGING
    for (i = 0; i < NU; i++) {
        left += U_WEIGHT[i] * magnitude(out->drive[i] - wanted[i]);
    }
    status |= follow_on(at, join, &join[NY], left);
#endif
#if FILLED
    at->unused = 0U;
#endif
    at->ready = LIMITER_BUILD;
    return status;
}

uint32_t limiter_step(limiter_state *state, const real target[M], limiter_output *out)
{
    uint32_t status = LIMITER_INPUT;
    if (out == NULL) {
        /* nothing is written */
    } else if (state == NULL) {
        set_safe(out);
    } else if ((state->ready != LIMITER_BUILD) || (is_lost(state) != 0)) {
        status = set_lost(state, out);
    } else if ((target == NULL) || (is_usable(target) == 0)) {
        settle_safe(state, out);
#if RINGING
        status |= stay(state);
#endif
    } else {
        limiter_state at;
        uint32_t broken;
#if RINGING
        at = *state;
#endif
        MOTION_DISPLACEMENT(target, at.z);
        MOTION_STATE(target, at.x);
        broken = motion_broken(&at);
        if (broken == 0U) {
            status = motion_drives(&at, state, target, out);
            *state = at;
        } else {
            status = broken | limiter_settle(state, target, out);
        }
    }
    return status;
}
