/* Copyright 2026 The manifold_mpc_ros authors
 * SPDX-License-Identifier: Apache-2.0
 *
 * Another processor's numpy, for LD_PRELOAD: products of matrices and vectors add up in another
 * order, and the elementary functions round otherwise. processors.py builds and uses it where the
 * processor that is wanted (AVX-512) is not there.
 *
 * Every product is accurate: one sum a value, each kind of product in an order of its own, as
 * kernels of OpenBLAS are. The functions err by at most 0.6 units in the last place, and only when
 * numpy calls them: the C library's own are left to everybody else, as where numpy brings SVML.
 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <link.h>
#include <math.h>
#include <stdint.h>
#include <string.h>

enum { ROW_MAJOR = 101, NO_TRANSPOSE = 111, UPPER = 121 };

/* Four partial sums, as of a vector register; what is left over goes to the first. */
double scipy_cblas_ddot64_(int64_t n, const double *x, int64_t step_x, const double *y,
                           int64_t step_y)
{
    double part[4] = {0.0, 0.0, 0.0, 0.0};
    if (step_x < 0)
        x -= (n - 1) * step_x;
    if (step_y < 0)
        y -= (n - 1) * step_y;
    for (int64_t i = 0; i < n; ++i)
        part[i % 4] = fma(x[i * step_x], y[i * step_y], part[i % 4]);
    return (part[0] + part[2]) + (part[1] + part[3]);
}

/* The sum over k of a[k * step_a] b[k * step_b], from the last term to the first. */
static double backward(int64_t n, const double *a, int64_t step_a, const double *b, int64_t step_b)
{
    double sum = 0.0;
    while (n-- > 0)
        sum = fma(a[n * step_a], b[n * step_b], sum);
    return sum;
}

static void put(double *value, double alpha, double sum, double beta)
{
    *value = beta == 0.0 ? alpha * sum : alpha * sum + beta * *value;
}

void scipy_cblas_dgemv64_(int order, int transposed, int64_t rows, int64_t columns, double alpha,
                          const double *a, int64_t lead, const double *x, int64_t step_x,
                          double beta, double *y, int64_t step_y)
{
    int along = (order == ROW_MAJOR) == (transposed == NO_TRANSPOSE); /* a sum along memory */
    int plain = transposed == NO_TRANSPOSE;
    int64_t results = plain ? rows : columns, terms = plain ? columns : rows;
    if (step_x < 0)
        x -= (terms - 1) * step_x;
    if (step_y < 0)
        y -= (results - 1) * step_y;
    for (int64_t i = 0; i < results; ++i) {
        double sum = 0.0;
        if (along)
            sum = scipy_cblas_ddot64_(terms, a + i * lead, 1, x, step_x);
        else
            for (int64_t k = 0; k < terms; ++k)
                sum = fma(a[k * lead + i], x[k * step_x], sum);
        put(y + i * step_y, alpha, sum, beta);
    }
}

void scipy_cblas_dgemm64_(int order, int transposed_a, int transposed_b, int64_t m, int64_t n,
                          int64_t terms, double alpha, const double *a, int64_t lead_a,
                          const double *b, int64_t lead_b, double beta, double *c, int64_t lead_c)
{
    int row_major = order == ROW_MAJOR;
    int along_a = row_major == (transposed_a == NO_TRANSPOSE);
    int along_b = row_major != (transposed_b == NO_TRANSPOSE);
    for (int64_t i = 0; i < m; ++i)
        for (int64_t j = 0; j < n; ++j)
            put(c + (row_major ? i * lead_c + j : j * lead_c + i), alpha, backward(
                    terms, a + i * (along_a ? lead_a : 1), along_a ? 1 : lead_a,
                    b + j * (along_b ? lead_b : 1), along_b ? 1 : lead_b), beta);
}

void scipy_cblas_dsyrk64_(int order, int half, int transposed, int64_t n, int64_t terms,
                          double alpha, const double *a, int64_t lead, double beta, double *c,
                          int64_t lead_c)
{
    int row_major = order == ROW_MAJOR;
    int along = row_major == (transposed == NO_TRANSPOSE);
    for (int64_t i = 0; i < n; ++i)
        for (int64_t j = half == UPPER ? i : 0; j < (half == UPPER ? n : i + 1); ++j)
            put(c + (row_major ? i * lead_c + j : j * lead_c + i), alpha, backward(
                    terms, a + i * (along ? lead : 1), along ? 1 : lead,
                    a + j * (along ? lead : 1), along ? 1 : lead), beta);
}

/* Where numpy's code lies; not before it is loaded. */
static uintptr_t numpy_from, numpy_to;

static int find_numpy(struct dl_phdr_info *info, size_t size, void *unused)
{
    (void)size, (void)unused;
    if (!strstr(info->dlpi_name, "_multiarray_umath"))
        return 0;
    for (int i = 0; i < info->dlpi_phnum; ++i) {
        const ElfW(Phdr) *part = &info->dlpi_phdr[i];
        if (part->p_type == PT_LOAD && part->p_flags & PF_X) {
            numpy_to = info->dlpi_addr + part->p_vaddr + part->p_memsz;
            numpy_from = info->dlpi_addr + part->p_vaddr;
        }
    }
    return 1;
}

static int is_numpy(const void *caller)
{
    if (!numpy_from)
        dl_iterate_phdr(find_numpy, 0);
    return (uintptr_t)caller >= numpy_from && (uintptr_t)caller < numpy_to;
}

/* Nearly the nearest number: where two are almost equally near, the other one. */
static double rounded(long double exact)
{
    double nearest = (double)exact;
    long double off = exact - nearest;
    if (off == 0.0L || !isfinite(nearest))
        return nearest;
    double other = nextafter(nearest, off > 0.0L ? INFINITY : -INFINITY);
    return fabsl(exact - other) < 1.5L * fabsl(off) ? other : nearest;
}

#define ONE(name) \
    double name(double x) \
    { \
        static double (*plain)(double); \
        if (is_numpy(__builtin_return_address(0))) \
            return rounded(name##l(x)); \
        if (!plain) \
            plain = (double (*)(double))dlsym(RTLD_NEXT, #name); \
        return plain(x); \
    }

#define TWO(name) \
    double name(double x, double y) \
    { \
        static double (*plain)(double, double); \
        if (is_numpy(__builtin_return_address(0))) \
            return rounded(name##l(x, y)); \
        if (!plain) \
            plain = (double (*)(double, double))dlsym(RTLD_NEXT, #name); \
        return plain(x, y); \
    }

ONE(sin) ONE(cos) ONE(tan) ONE(asin) ONE(acos) ONE(atan) ONE(sinh) ONE(cosh) ONE(tanh)
ONE(asinh) ONE(acosh) ONE(atanh) ONE(exp) ONE(exp2) ONE(expm1) ONE(log) ONE(log2) ONE(log10)
ONE(log1p) ONE(cbrt) TWO(pow) TWO(atan2)
