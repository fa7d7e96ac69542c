/* In place of what CasADi's code generator writes for full matrices, four rows at a time. The sums are taken in the same order. */
#pragma GCC push_options
#pragma GCC optimize ("O2") /* the rest is compiled to be there soon */
typedef casadi_real casadi_four __attribute__((vector_size(4*sizeof(casadi_real)), aligned(sizeof(casadi_real)), may_alias));
#define FOUR(p) (*(casadi_four*)(p))

static inline void casadi_clear(casadi_real* x, casadi_int n) {
  const casadi_four zeros = {0, 0, 0, 0};
  casadi_int i;
  if (!x) return;
  for (i = 0; i + 4 <= n; i += 4) FOUR(x + i) = zeros;
  for (; i < n; ++i) x[i] = 0;
}

static inline void casadi_copy(const casadi_real* x, casadi_int n, casadi_real* y) {
  casadi_int i;
  if (!y) return;
  if (!x) {
    casadi_clear(y, n);
    return;
  }
  for (i = 0; i + 4 <= n; i += 4) FOUR(y + i) = FOUR(x + i);
  for (; i < n; ++i) y[i] = x[i];
}

/* Over a column of y: `load` rows of z, `add` those of x times each entry, `store` them. */
#define COLUMN(load, add, store) \
  load for (k = first[j]; k < first[j + 1]; ++k) { \
    const casadi_real by = y[k], *at = x + row[k]*n + i; \
    add \
  } store

/* z (n, m) += x (n, l) y (l, m), x and z full. The last four of n rows may overlap those before: both hold the same sums. */
static void casadi_mtimes_dense_sparse(const casadi_real* x, casadi_int n, const casadi_real* y, const casadi_int* sp_y,
                                       casadi_real* z) {
  const casadi_int m = sp_y[1], *first = sp_y + 2, *row = sp_y + 3 + m;
  casadi_int i, j, k;
  for (j = 0; j < m; ++j, z += n) {
    if (first[j] == first[j + 1]) continue;
    for (i = 0; n - i > 16; i += 8) {
      COLUMN(casadi_four a = FOUR(z + i); casadi_four b = FOUR(z + i + 4);,
             a += FOUR(at)*by; b += FOUR(at + 4)*by;,
             FOUR(z + i) = a; FOUR(z + i + 4) = b;)
    }
    const casadi_int last = n - i - 4;
    casadi_real* to = z + i;
    if (last > 8) {
      COLUMN(casadi_four a = FOUR(to); casadi_four b = FOUR(to + 4); casadi_four c = FOUR(to + 8); casadi_four d = FOUR(to + last);,
             a += FOUR(at)*by; b += FOUR(at + 4)*by; c += FOUR(at + 8)*by; d += FOUR(at + last)*by;,
             FOUR(to) = a; FOUR(to + 4) = b; FOUR(to + 8) = c; FOUR(to + last) = d;)
    } else if (last > 4) {
      COLUMN(casadi_four a = FOUR(to); casadi_four b = FOUR(to + 4); casadi_four d = FOUR(to + last);,
             a += FOUR(at)*by; b += FOUR(at + 4)*by; d += FOUR(at + last)*by;,
             FOUR(to) = a; FOUR(to + 4) = b; FOUR(to + last) = d;)
    } else if (last > 0) {
      COLUMN(casadi_four a = FOUR(to); casadi_four d = FOUR(to + last);,
             a += FOUR(at)*by; d += FOUR(at + last)*by;,
             FOUR(to) = a; FOUR(to + last) = d;)
    } else if (last == 0) {
      COLUMN(casadi_four a = FOUR(to);, a += FOUR(at)*by;, FOUR(to) = a;)
    } else {
      for (k = first[j]; k < first[j + 1]; ++k)
        for (i = 0; i < n; ++i) z[i] += x[row[k]*n + i]*y[k];
    }
  }
}
#pragma GCC pop_options
