#if defined(__FAST_MATH__)
#error "fast-math changes results: compile without it"
#endif
/* 16 and 32 are of shorter floats: double stays what it is. */
#if defined(FLT_EVAL_METHOD) && (FLT_EVAL_METHOD < 0 || FLT_EVAL_METHOD == 1 || FLT_EVAL_METHOD == 2)
#error "double arithmetic has to be of 64 bits: on x86 compile with -msse2 -mfpmath=sse"
#endif

#define UNUSED(x) ((void)(x))

static inline uint64_t to_bits(double x) {
    uint64_t bits;
    memcpy(&bits, &x, sizeof bits);
    return bits;
}

static inline double from_bits(uint64_t bits) {
    double x;
    memcpy(&x, &bits, sizeof x);
    return x;
}

static inline double negated_where(double x, double sign) {
    return from_bits(to_bits(x) ^ (to_bits(sign) & ((uint64_t)1 << 63)));
}
