// SPDX-License-Identifier: Apache-2.0
// Four numbers that the processor works on at once: one register of AVX2 (DKB_WIDE), or two of SSE2 or NEON. Included
// once per instruction set, by kernels.inl, with DKB_KERNEL set to the function attribute. Both kinds do the same
// operations number by number, so they give the same bits.

#if DKB_WIDE

using Pack = double __attribute__((vector_size(32)));
using Mask = long long __attribute__((vector_size(32)));

DKB_KERNEL inline Pack make(double a, double b, double c, double d) { return Pack{a, b, c, d}; }
DKB_KERNEL inline double sum(const Pack& x) { return (x[0] + x[1]) + (x[2] + x[3]); }
DKB_KERNEL inline bool any(const Mask& m) { return (m[0] | m[1] | m[2] | m[3]) != 0; }
DKB_KERNEL inline Pack select(const Mask& m, const Pack& a, const Pack& b) { return m ? a : b; }
DKB_KERNEL inline Pack square_root(const Pack& x) {
  return Pack{__builtin_sqrt(x[0]), __builtin_sqrt(x[1]), __builtin_sqrt(x[2]), __builtin_sqrt(x[3])};
}
// (a2, a3, b0, b1)
DKB_KERNEL inline Pack straddle(const Pack& a, const Pack& b) { return __builtin_shufflevector(a, b, 2, 3, 4, 5); }
DKB_KERNEL inline void transpose(Pack& a, Pack& b, Pack& c, Pack& d) {
  const Pack ab_low = __builtin_shufflevector(a, b, 0, 4, 2, 6), ab_high = __builtin_shufflevector(a, b, 1, 5, 3, 7);
  const Pack cd_low = __builtin_shufflevector(c, d, 0, 4, 2, 6), cd_high = __builtin_shufflevector(c, d, 1, 5, 3, 7);
  a = __builtin_shufflevector(ab_low, cd_low, 0, 1, 4, 5);
  b = __builtin_shufflevector(ab_high, cd_high, 0, 1, 4, 5);
  c = __builtin_shufflevector(ab_low, cd_low, 2, 3, 6, 7);
  d = __builtin_shufflevector(ab_high, cd_high, 2, 3, 6, 7);
}

#else

using Half = double __attribute__((vector_size(16)));
using HalfMask = long long __attribute__((vector_size(16)));
struct Pack {
  Half low, high;
};
struct Mask {
  HalfMask low, high;
};

DKB_KERNEL inline Pack make(double a, double b, double c, double d) { return {Half{a, b}, Half{c, d}}; }
DKB_KERNEL inline Pack operator+(const Pack& a, const Pack& b) { return {a.low + b.low, a.high + b.high}; }
DKB_KERNEL inline Pack operator-(const Pack& a, const Pack& b) { return {a.low - b.low, a.high - b.high}; }
DKB_KERNEL inline Pack operator*(const Pack& a, const Pack& b) { return {a.low * b.low, a.high * b.high}; }
DKB_KERNEL inline Pack operator/(const Pack& a, const Pack& b) { return {a.low / b.low, a.high / b.high}; }
DKB_KERNEL inline Pack operator+(const Pack& a, double b) { return {a.low + b, a.high + b}; }
DKB_KERNEL inline Pack operator-(double a, const Pack& b) { return {a - b.low, a - b.high}; }
DKB_KERNEL inline Pack operator*(double a, const Pack& b) { return {a * b.low, a * b.high}; }
DKB_KERNEL inline Pack operator*(const Pack& a, double b) { return {a.low * b, a.high * b}; }
DKB_KERNEL inline Pack operator/(double a, const Pack& b) { return {a / b.low, a / b.high}; }
DKB_KERNEL inline Pack operator-(const Pack& a) { return {-a.low, -a.high}; }
DKB_KERNEL inline Pack& operator+=(Pack& a, const Pack& b) { return a = a + b; }
DKB_KERNEL inline Pack& operator-=(Pack& a, const Pack& b) { return a = a - b; }
DKB_KERNEL inline Mask operator>(const Pack& a, const Pack& b) { return {a.low > b.low, a.high > b.high}; }
DKB_KERNEL inline Mask operator<(const Pack& a, const Pack& b) { return {a.low < b.low, a.high < b.high}; }
DKB_KERNEL inline double sum(const Pack& x) { return (x.low[0] + x.low[1]) + (x.high[0] + x.high[1]); }
DKB_KERNEL inline bool any(const Mask& m) { return (m.low[0] | m.low[1] | m.high[0] | m.high[1]) != 0; }
DKB_KERNEL inline Pack select(const Mask& m, const Pack& a, const Pack& b) {
  const auto half = [](const HalfMask& n, const Half& x, const Half& y) {
    return reinterpret_cast<Half>((n & reinterpret_cast<HalfMask>(x)) | (~n & reinterpret_cast<HalfMask>(y)));
  };
  return {half(m.low, a.low, b.low), half(m.high, a.high, b.high)};
}
DKB_KERNEL inline Pack square_root(const Pack& x) {
  return make(__builtin_sqrt(x.low[0]), __builtin_sqrt(x.low[1]), __builtin_sqrt(x.high[0]), __builtin_sqrt(x.high[1]));
}
DKB_KERNEL inline Pack straddle(const Pack& a, const Pack& b) { return {a.high, b.low}; }
DKB_KERNEL inline void transpose(Pack& a, Pack& b, Pack& c, Pack& d) {
  const auto first = [](const Half& x, const Half& y) { return __builtin_shufflevector(x, y, 0, 2); };
  const auto second = [](const Half& x, const Half& y) { return __builtin_shufflevector(x, y, 1, 3); };
  const Pack a0{first(a.low, b.low), first(c.low, d.low)}, a1{second(a.low, b.low), second(c.low, d.low)};
  const Pack a2{first(a.high, b.high), first(c.high, d.high)}, a3{second(a.high, b.high), second(c.high, d.high)};
  a = a0, b = a1, c = a2, d = a3;
}

#endif

DKB_KERNEL inline Pack all(double x) { return make(x, x, x, x); }
DKB_KERNEL inline Pack load(const double* p) {
  Pack x;
  __builtin_memcpy(&x, p, sizeof x);
  return x;
}
DKB_KERNEL inline void store(double* p, const Pack& x) { __builtin_memcpy(p, &x, sizeof x); }
DKB_KERNEL inline void add_to(double* p, const Pack& x) { store(p, load(p) + x); }
