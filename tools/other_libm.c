/* Another C library, as far as results go: half of all inexact elementary functions are off by a unit in the last place.
   What every library gives exactly, such as whole powers of two, stays exact. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <math.h>
#include <stdint.h>
#include <string.h>

static double off(double x, double y, double result) {
    uint64_t bits, other;
    if (!isfinite(result) || result == 0.0 || fabs(result) == 1.0) return result;
    memcpy(&bits, &x, 8);
    memcpy(&other, &y, 8);
    bits = (bits ^ (other * 0x9E3779B97F4A7C15u)) * 0xBF58476D1CE4E5B9u;
    switch ((bits >> 60) & 3) {
        case 0: return nextafter(result, INFINITY);
        case 1: return nextafter(result, -INFINITY);
        default: return result;
    }
}
#define REAL(name) ({ static __typeof__(&name) real; if (!real) real = (__typeof__(&name))dlsym(RTLD_NEXT, #name); real; })
#define ONE(name) double name(double x) { return off(x, 0.0, REAL(name)(x)); }
#define TWO(name) double name(double x, double y) { double r = REAL(name)(x, y); return fabs(x) == fabs(y) ? r : off(x, y, r); }
ONE(sin) ONE(cos) ONE(tan) ONE(asin) ONE(acos) ONE(atan) ONE(sinh) ONE(cosh) ONE(tanh) ONE(exp) ONE(expm1)
ONE(log) ONE(log1p) ONE(cbrt)
TWO(hypot)
double atan2(double y, double x) { double r = REAL(atan2)(y, x); return x == 0.0 || y == 0.0 || fabs(x) == fabs(y) ? r : off(y, x, r); }
double exp2(double x) { double r = REAL(exp2)(x); return x == rint(x) ? r : off(x, 0.0, r); }
double log2(double x) { double r = REAL(log2)(x); return r == rint(r) ? r : off(x, 0.0, r); }
double log10(double x) { double r = REAL(log10)(x); return r == rint(r) ? r : off(x, 0.0, r); }
double pow(double x, double y) {
    double r = REAL(pow)(x, y);
    int e;
    if (frexp(fabs(x), &e) == 0.5 || (x == rint(x) && y == rint(y) && fabs(r) < 9007199254740992.0 && r == rint(r))) return r;
    return off(x, y, r);
}
void sincos(double x, double *s, double *c) { *s = sin(x); *c = cos(x); }
float sinf(float x) { return nextafterf(REAL(sinf)(x), x > 1 ? 2.0f : -2.0f); }
float cosf(float x) { float r = REAL(cosf)(x); return fabsf(r) == 1.0f ? r : nextafterf(r, x > 1 ? 2.0f : -2.0f); }
