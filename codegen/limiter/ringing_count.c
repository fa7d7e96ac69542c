/* How far the device may be off the motion that it is to follow. limiter.c includes this for a device with inertia. */

static real magnitude(real of)
{
    return (of < REAL(0.0)) ? -of : of;
}

/* Where a device that stays in its state is led, weighted. */
static void set_still(const limiter_state *state, real still[NY])
{
    static const real X_WEIGHT[NX] = X_WEIGHT_TABLE; /* in units of what is told, per SI */
    static const real Z_WEIGHT[N] = Z_WEIGHT_TABLE;
    int i;
    for (i = 0; i < NX; i++) {
        still[i] = X_WEIGHT[i] * state->x[i];
    }
    for (i = 0; i < N; i++) {
        still[NX + i] = Z_WEIGHT[i] * state->z[i];
    }
#if NY > (NX + N)
    for (i = NX + N; i < NY; i++) {
        still[i] = REAL(0.0);
    }
#endif
}

/* UNSURE while the device may ring by more than is told, beside what held drives leave. */
static uint32_t is_ringing(const limiter_state *state, real held)
{
    const real size = state->ringing + held;
    return ((is_nan(&size) != 0) || (size > TOLD)) ? LIMITER_UNSURE : 0U;
}

/* What a break of the motion, and what is left of drives, adds to a ringing. */
static real added(const limiter_state *state, const real from[NY], real left)
{
    real size = left;
    int i;
    for (i = 0; i < NY; i++) {
        size += magnitude(from[i] - state->ahead[i]);
    }
    return ((is_nan(&size) == 0) && (size <= LEAST_BREAK)) ? REAL(0.0) : size;
}

/* A ringing of this size about a motion that leads ahead: the device itself is never farther from rest than unknown. */
static real bounded(real size, const real ahead[NY])
{
    static const real HOME_AHEAD[NY] = HOME_AHEAD_TABLE; /* of rest */
    real most = UNKNOWN_RINGING;
    real left = size;
    int i;
    for (i = 0; i < NY; i++) {
        most += magnitude(ahead[i] - HOME_AHEAD[i]);
    }
    if ((is_nan(&left) == 0) && (left > most)) {
        left = most;
    }
    if ((is_nan(&left) == 0) && (left < GONE)) { /* denormal numbers are slow */
        left = REAL(0.0);
    }
    return left;
}

/* A sample of a motion that comes from here and leads ahead; the clock of step_at goes on by one. */
static uint32_t follow_on(limiter_state *state, const real from[NY], const real ahead[NY], real left)
{
    static const real HELD[NY] = HELD_TABLE; /* what a held drive leaves, per change in a sample */
    const real size = (state->ringing * DECAY) + added(state, from, left);
    real held = REAL(0.0);
    int i;
    state->tick += 1U;
    state->ringing = bounded(size, ahead);
    for (i = 0; i < NY; i++) {
        held += HELD[i] * magnitude(ahead[i] - from[i]);
        state->ahead[i] = ahead[i];
    }
    return is_ringing(state, held);
}

/* A sample of a motion that ends where the state is. */
static uint32_t stay(limiter_state *state)
{
    real still[NY];
    set_still(state, still);
    return follow_on(state, still, still, REAL(0.0));
}
