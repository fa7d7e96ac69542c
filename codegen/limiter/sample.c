/* One sample: an equilibrium where SETTLING, else the next one. limiter.c includes this once for each. */
#if SETTLING
#if VARIED
#define SAMPLE static uint32_t settle_sample
#else
#define SAMPLE uint32_t limiter_settle
#endif
#define SAFE settle_safe
#define LIMIT_DRIVES settle_limit_drives
#define PROCEED settle_proceed
#define WITHIN settle_within
#define BEYOND settle_beyond
#define UNUSABLE settle_unusable
#define DISPLACEMENT SETTLE_DISPLACEMENT
#define STATE SETTLE_STATE
#define DRIVE SETTLE_DRIVE
#define NEXT_STATES SETTLE_ADVANCE
#define NEXT_FROM out->displacement
#define DRIVE_LIMITED SETTLE_DRIVE_LIMITED
#define EXAMINED_FIRST SETTLE_EXAMINED_FIRST
#else
#if VARIED
#define SAMPLE static uint32_t step_sample
#else
#define SAMPLE uint32_t limiter_step
#endif
#define SAFE step_safe
#define LIMIT_DRIVES step_limit_drives
#define PROCEED step_proceed
#define WITHIN step_within
#define BEYOND step_beyond
#define UNUSABLE step_unusable
#define DISPLACEMENT STEP_DISPLACEMENT
#define STATE STEP_STATE
#define DRIVE STEP_DRIVE
#define NEXT_STATES STEP_ADVANCE
#define NEXT_FROM state->z
#define DRIVE_LIMITED STEP_DRIVE_LIMITED
#define EXAMINED_FIRST STEP_EXAMINED_FIRST
#endif
#if EXAMINED_FIRST
#define CANNOT_BE_USED (state->ready != LIMITER_BUILD) || (is_lost(state) != 0)
#define WAS_BEYOND hit != 0
#else
#define CANNOT_BE_USED state->ready != LIMITER_BUILD
#define WAS_BEYOND (hit != 0) && (status != LIMITER_LOST)
#endif
#if DRIVE_LIMITED
#define KEEP_DRIVES status |= LIMIT_DRIVES(state, out, &limited);
#define GO_ON PROCEED(state, out, limited);
#else /* no displacement in range needs more than rounding beyond */
#define KEEP_DRIVES (void)limit_all(out->drive, U_LOW, U_HIGH, U_SLACK, NU);
#define GO_ON PROCEED(state, out);
#endif
#define KEEP_STATE(k) state->x[k] = out->state[k];
#define TELL_STATE(k) out->state[k] = state->x[k];
#define KEEP_DISPLACEMENT(k) state->z[k] = out->displacement[k];
#define KEEP_DRIVE(k) state->u[k] = out->drive[k];

/* Without a usable target: the safe drive, as fast as it may change, and the state that it leads to. */
static void SAFE(limiter_state *state, limiter_output *out)
{
#if RATED
    real share = REAL(1.0);
#endif
#if ESTIMATED && SETTLING
    real before[NX];
#endif
    int i;
#if ESTIMATED && SETTLING
    copy_states(state->x, before);
#endif
    for (i = 0; i < NU; i++) {
        out->drive[i] = U_SAFE[i];
    }
    for (i = 0; i < N; i++) {
        out->displacement[i] = state->z[i];
    }
#if NS
    for (i = 0; i < NS; i++) {
        out->state[i] = state->x[i];
    }
#endif
#if RATED
    (void)limit_rate(state, out->drive, &share);
    for (i = 0; i < NU; i++) {
        state->u[i] = out->drive[i];
    }
#endif
#if NX
    NEXT_STATES(state, state->z, out->drive, state->x);
#endif
    BALANCE(state, state->x, out->displacement, out->drive, state->z);
#if ESTIMATED && SETTLING
    mark_moved(state, before);
#endif
}

#if DRIVE_LIMITED
/* Keeps the limits of drives that out->drive does not keep; limited is 1 then if the device does not come to out->displacement. */
static uint32_t LIMIT_DRIVES(const limiter_state *state, limiter_output *out, int *limited)
{
#if SETTLING
    static const real HOME[N] = HOME_TABLE;
#endif
    uint32_t status = 0U;
#if OWN_DRIVES && SETTLING
    status = into_reach(state, 1, HOME, out, limited);
#elif OWN_DRIVES
    status = into_reach(state, 0, state->z, out, limited);
#else
    if (drives_admissible(state, out->drive) != 0) {
        (void)limit_all(out->drive, U_LOW, U_HIGH, U_SLACK, NU);
    } else {
#if SETTLING
        *limited = line_search(state, 1, HOME, out);
#else
        *limited = line_search(state, 0, state->z, out);
#endif
        status = LIMITER_DRIVE;
    }
#endif
    return status;
}

#endif
#if DRIVE_LIMITED
/* The state becomes that of the next sample; so do displacement and state of out, to which the device does not come where limited is 1. */
static void PROCEED(limiter_state *state, limiter_output *out, int limited)
#else
/* The state becomes that of the next sample. */
static void PROCEED(limiter_state *state, const limiter_output *out)
#endif
{
#if NX > NS
    NEXT_STATES(state, NEXT_FROM, out->drive, state->x);
#elif NS && DRIVE_LIMITED
    if (limited != 0) {
        NEXT_STATES(state, NEXT_FROM, out->drive, state->x);
    } else { /* the drive was computed for these; one by one, because a loop costs a small core twice as much */
        EACH_STATE(KEEP_STATE)
    }
#elif NS
    EACH_STATE(KEEP_STATE)
#endif
#if DRIVE_LIMITED
    if (limited != 0) {
        BALANCE(state, state->x, out->displacement, out->drive, out->displacement);
#if NS
        EACH_STATE(TELL_STATE)
#endif
    }
#endif
    EACH_AXIS(KEEP_DISPLACEMENT)
#if RATED
    EACH_DRIVE(KEEP_DRIVE)
#endif
}

#if BOUND_FIRST
/* Drives for out->displacement with every limit kept, the composite ones are already where kept is 1; the state becomes that of the next
 * sample. */
static uint32_t WITHIN(limiter_state *state, limiter_output *out, int kept)
#else
/* Drives for out->displacement with every limit kept; the state becomes that of the next sample. */
static uint32_t WITHIN(limiter_state *state, limiter_output *out)
#endif
{
#if U_BOUNDS_ONCE && defined(U_LOW_TABLE)
    static const real U_LOW[NU] = U_LOW_TABLE;
#endif
#if U_BOUNDS_ONCE && defined(U_HIGH_TABLE)
    static const real U_HIGH[NU] = U_HIGH_TABLE;
#endif
#if U_BOUNDS_ONCE
    static const real U_SLACK[NU] = U_SLACK_TABLE;
#endif
    uint32_t status = 0U;
#if DRIVE_LIMITED
    int limited = 0;
#endif
#if !EXAMINED_FIRST
    int lost = 0;
#endif
#if RATED
    real share = REAL(1.0);
    int held = 0;
#endif
#if ESTIMATED && SETTLING
    real before[NX];
    copy_states(state->x, before);
#endif
#if STATE_LIMITED
    STATE(state, out->displacement, out->state);
    if (STATE_INSIDE(state, out->state) == 0) {
        status |= keep_state(state, out);
    }
#endif
#if BOUND_FIRST
    if (kept == 0) {
        const int scaled = scale_home(state, out->displacement);
#elif SHARES
    {
        const int scaled = LIMIT_COMPOSITE(state, out->displacement);
#endif
#if SHARES
        if (scaled > 0) {
            if (scaled > 1) {
                status |= LIMITER_COMPOSITE;
            }
#if STATE_LIMITED
            STATE(state, out->displacement, out->state);
            (void)limit_state(state, out->state);
#endif
        }
    }
#endif
#if NS && !STATE_LIMITED
    STATE(state, out->displacement, out->state);
#endif
    DRIVE(state, out->displacement, out->state, out->drive);
#if REDUNDANT
    choose_drives(state, out->drive);
#endif
#if EXAMINED_FIRST
    if (DRIVE_INSIDE(state, out->drive) == 0) {
        KEEP_DRIVES
    }
#else
    if (DRIVE_INSIDE(state, out->drive) == 0) {
        if (is_lost(state) != 0) {
            status = set_lost(state, out);
            lost = 1;
        } else {
            KEEP_DRIVES
        }
    }
#endif
#if RATED && EXAMINED_FIRST
    held = limit_rate(state, out->drive, &share);
#elif RATED
    if (lost == 0) {
        held = limit_rate(state, out->drive, &share);
        if ((held != 0) && (is_lost(state) != 0)) {
            status = set_lost(state, out);
            lost = 1;
            held = 0;
        }
    }
#endif
#if RATED
    if (held > 1) {
        int i;
        for (i = 0; i < N; i++) {
            out->displacement[i] = state->z[i] + (share * (out->displacement[i] - state->z[i]));
        }
        limited = 1;
        status |= LIMITER_RATE;
    }
#endif
#if EXAMINED_FIRST
    GO_ON
#if ESTIMATED && SETTLING
    mark_moved(state, before);
#endif
#if ESTIMATED
    status |= count_down(state);
#endif
#if RINGING
    status |= stay(state);
#endif
#else
    if (lost == 0) {
        GO_ON
#if ESTIMATED && SETTLING
        mark_moved(state, before);
#endif
#if ESTIMATED
        status |= count_down(state);
#endif
#if RINGING
        status |= stay(state);
#endif
    }
#endif
#if RATED && PASSING
    if (held > 1) {
        status |= passed(state);
    }
#endif
    return status;
}

/* The same for out->displacement beyond its range. */
static uint32_t BEYOND(limiter_state *state, limiter_output *out)
{
    uint32_t status;
    int hit;
#if COUPLED
    real beyond[N];
    int i;
    for (i = 0; i < N; i++) {
        beyond[i] = out->displacement[i];
    }
#endif
#if COUPLED
    hit = nearest_displacement(beyond, out->displacement);
#else
    hit = limit_displacement(out->displacement);
#endif
#if BOUND_FIRST /* at the end of the range the cheap bound seldom tells, and with it the longest call would be longer */
    status = WITHIN(state, out, 0);
#else
    status = WITHIN(state, out);
#endif
    if (WAS_BEYOND) {
        status |= LIMITER_DISPLACEMENT;
    }
    return status;
}

/* The answer to a target that is no command, or to none. */
static uint32_t UNUSABLE(limiter_state *state, limiter_output *out)
{
    uint32_t status = LIMITER_INPUT;
#if EXAMINED_FIRST
    SAFE(state, out);
#if ESTIMATED
    status |= count_down(state);
#endif
#if RINGING
    status |= stay(state);
#endif
#else
    if (is_lost(state) != 0) {
        status = set_lost(state, out);
    } else {
        SAFE(state, out);
#if ESTIMATED
        status |= count_down(state);
#endif
#if RINGING
        status |= stay(state);
#endif
    }
#endif
    return status;
}

SAMPLE(limiter_state *state, const real target[M], limiter_output *out)
{
    uint32_t status = LIMITER_INPUT;
    if (out == NULL) {
        /* nothing is written */
    } else if (state == NULL) {
        set_safe(out);
    } else if (CANNOT_BE_USED) {
        status = set_lost(state, out);
#if DIRECT
    } else if (target == NULL) {
        status = UNUSABLE(state, out);
    } else { /* whether a target is a command is asked where it leads beyond the range alone: what is none, NaN too, does */
#if BOUND_FIRST
        int kept = 0;
        if (TARGET_BOUND(target) <= REAL(1.0)) { /* before out, which may be the target */
            kept = 1;
        }
#endif
        DISPLACEMENT(state, target, out->displacement);
        if (displacement_inside(out->displacement) != 0) {
#if BOUND_FIRST
            status = WITHIN(state, out, kept);
#else
            status = WITHIN(state, out);
#endif
        } else if (is_usable(target) != 0) {
            status = BEYOND(state, out);
        } else {
            status = UNUSABLE(state, out);
        }
    }
#else
    } else if ((target != NULL) && (is_usable(target) != 0)) {
        DISPLACEMENT(state, target, out->displacement);
        if (displacement_inside(out->displacement) != 0) {
            status = WITHIN(state, out);
        } else {
            status = BEYOND(state, out);
        }
    } else {
        status = UNUSABLE(state, out);
    }
#endif
    return status;
}
#undef SAMPLE
#undef SAFE
#undef LIMIT_DRIVES
#undef PROCEED
#undef WITHIN
#undef BEYOND
#undef UNUSABLE
#undef DISPLACEMENT
#undef STATE
#undef DRIVE
#undef NEXT_STATES
#undef NEXT_FROM
#undef DRIVE_LIMITED
#undef EXAMINED_FIRST
#undef KEEP_DRIVES
#undef GO_ON
#undef CANNOT_BE_USED
#undef WAS_BEYOND
#undef KEEP_STATE
#undef TELL_STATE
#undef KEEP_DISPLACEMENT
#undef KEEP_DRIVE
