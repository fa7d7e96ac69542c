/* Constants that are given when the program starts. limiter.c includes this for a device that has some. */

/* Computes what follows from the constants of the state. */
static void set_derived(limiter_state *state)
{
    const real given[GIVEN] = GIVEN_VALUES;
    real value[DERIVED_VALUES];
    derive(given, value);
    SET_DERIVED
}

/* 1 if every constant is a number within its bounds. */
static int constants_within(const limiter_constants *constants)
{
    return (CONSTANTS_WITHIN) ? 1 : 0;
}

const limiter_constants limiter_defaults = DEFAULTS;

uint32_t INIT_WITH(limiter_state *state, const limiter_constants *constants)
{
#if NX && !NS && !REST_GIVEN
    static const real X_REST[NX] = REST_TABLE; /* SI */
#endif
    uint32_t status = LIMITER_INPUT;
    if ((state == NULL) || (constants == NULL)) {
        /* nothing is written */
    } else if (constants_within(constants) == 0) {
        state->ready = 0U;
        status = LIMITER_CONSTANTS;
    } else {
        int i;
        state->constants = *constants;
        set_derived(state);
#if REST_GIVEN
        SET_REST
#elif NX
        for (i = 0; i < NX; i++) {
            state->x[i] = X_REST[i];
        }
#endif
        for (i = 0; i < N; i++) {
            state->z[i] = REAL(0.0);
        }
#if RATED
        for (i = 0; i < NU; i++) {
            state->u[i] = U_SAFE[i];
        }
#endif
#if ESTIMATED
        state->unsure = 0U;
        state->ticking = 0U;
        state->tick = 0U;
#endif
#if FILLED
        state->unused = 0U;
#endif
        state->ready = LIMITER_BUILD;
        status = 0U;
    }
    return status;
}

void INIT(limiter_state *state)
{
    (void)INIT_WITH(state, &limiter_defaults);
}

/* CRC-32 of IEEE 802.3, as of zlib. */
static uint32_t checksum(const uint8_t *bytes, uint32_t size)
{
    uint32_t crc = 0xFFFFFFFFU;
    uint32_t k;
    for (k = 0U; k < size; k++) {
        int bit;
        crc = crc ^ (uint32_t)bytes[k];
        for (bit = 0; bit < 8; bit++) {
            crc = ((crc & 1U) != 0U) ? ((crc >> 1U) ^ CRC_POLYNOMIAL) : (crc >> 1U);
        }
    }
    return crc ^ 0xFFFFFFFFU;
}

/* The little-endian word that begins there. */
static uint32_t word_at(const uint8_t *bytes, uint32_t k)
{
    return (uint32_t)bytes[k] | ((uint32_t)bytes[k + 1U] << 8U) | ((uint32_t)bytes[k + 2U] << 16U) | ((uint32_t)bytes[k + 3U] << 24U);
}

/* 1 if none of the words from 12 on, but the last, is the bits of a float that is infinite or no number. */
static int numbers_finite(const uint8_t *bytes, uint32_t size)
{
    int finite = 1;
    uint32_t k;
    for (k = 12U; k < (size - 4U); k = k + 4U) {
        if ((word_at(bytes, k) & 0x7F800000U) == 0x7F800000U) {
            finite = 0;
        }
    }
    return finite;
}

/* The IEEE 754 float of the word that begins there. */
static real number_at(const uint8_t *bytes, uint32_t k)
{
    union { float number; uint32_t bits; } v;
    v.bits = word_at(bytes, k);
#if DOUBLE
    return (double)v.number;
#else
    return v.number;
#endif
}

uint32_t limiter_load(limiter_constants *constants, const uint8_t *bytes, uint32_t size)
{
    uint32_t status = LIMITER_INPUT;
    if ((constants == NULL) || (bytes == NULL)) {
        /* nothing is written */
    } else if ((size != LIMITER_CONSTANTS_BYTES) || (word_at(bytes, 0U) != MAGIC) || (word_at(bytes, 4U) != LAYOUT)) {
        status = LIMITER_CONSTANTS;
    } else if ((word_at(bytes, 8U) != LIMITER_DEVICE_HASH) || (word_at(bytes, size - 4U) != checksum(bytes, size - 4U))) {
        status = LIMITER_CONSTANTS;
    } else {
        status = LIMITER_CONSTANTS;
        if (numbers_finite(bytes, size) != 0) {
            limiter_constants read;
            READ_CONSTANTS
            if (constants_within(&read) != 0) {
                *constants = read;
                status = 0U;
            }
        }
    }
    return status;
}
#if CHANGING

uint32_t SET_INPUT(limiter_state *state, real input)
{
    uint32_t status = LIMITER_INPUT;
    if (state == NULL) {
        /* nothing is written */
    } else if (state->ready != LIMITER_BUILD) {
        status = LIMITER_LOST;
    } else if (!(INPUT_WITHIN)) {
        status = LIMITER_CONSTANTS;
    } else {
        const real given[GIVEN] = CHANGED_VALUES;
        real value[CHANGED_DERIVED];
        derive_input(given, value);
        SET_CHANGED
        state->constants.INPUT_NAME = input;
        status = 0U;
    }
    return status;
}
#endif

