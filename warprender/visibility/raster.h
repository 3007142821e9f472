// Rasterization with exact coverage: homogeneous edge functions, a depth buffer, bins and tiles.
//
// raster_kernels.py pastes this text into the body of the functions that need it, so it holds only what C++ allows
// inside a function: types, and structs with static members. Warp defines float(x) and int(x) as macros, so casts are
// written (float)(x). Compile it with fuse_fp=False: a contracted a * b + c would break the error-free sums.
//
//   Expansion            sums and products of doubles without any rounding (Shewchuk 1997)
//   Triangle             its exact predicates: orientation, edges, clipping planes; depth and barycentrics
//   Mesh                 where triangles come from
//   Keyed                one thread a triangle, one key a pixel (CUDA)
//   Painter              sorted triangles, the last one stays
//   Linear, Fill         edge functions and depth over a rectangle, eight pixels at once
//   Bins, Corners, Batch, Binner triangles to bins by count, prefix sum and scatter, eight triangles at once
//   Tile                 one bin of the picture: draws what is in it, then barycentrics
//
// A pixel centre is the homogeneous point (a, b, 1) of a frame in which vertex k is P_k = (width x_k, height y_k, w_k):
// a = 2 column + 1 - width and b = height - 2 row - 1 are integers. With edge functions e_k = det(P_i, P_j, (a, b, 1))
// and D = det(P_0, P_1, P_2), the centre is sum (e_k / D) P_k: it is covered when no e_k / D is negative, whatever the
// signs of w (Olano and Greer, "Triangle Scan Conversion using 2D Homogeneous Coordinates", 1997). Nothing is divided
// by w before coverage is known, and nothing is cut at the eye plane.

#define RASTER_FN static inline CUDA_CALLABLE

typedef decltype(task) Task;  // RasterTask of raster_kernels.py, the argument of every function that holds this text

// ---------------------------------------------------------------- exact sums

// A sum of doubles that do not overlap, in order of growing magnitude: its sign is that of the last
// (Shewchuk, "Adaptive Precision Floating-Point Arithmetic", 1997). float32 inputs keep every term far from
// underflow and overflow.
struct Expansion {
    double term[160];
    int count;

    inline CUDA_CALLABLE void add(double b)
    {
        int kept = 0;
        for (int i = 0; i < count; ++i) {
            double a = term[i];
            double sum = a + b;
            double part = sum - a;
            double error = (a - (sum - part)) + (b - part);
            b = sum;
            if (error != 0.0)
                term[kept++] = error;
        }
        if (b != 0.0)
            term[kept++] = b;
        count = kept;
    }
    inline CUDA_CALLABLE void add(double a, double b)
    {
        double product = a * b;
        add(::fma(a, b, -product));
        add(product);
    }
    inline CUDA_CALLABLE void add(double a, double b, double c)
    {
        double product = a * b;
        add(::fma(a, b, -product), c);
        add(product, c);
    }
    inline CUDA_CALLABLE double value() const
    {
        double sum = 0.0;
        for (int i = 0; i < count; ++i)
            sum += term[i];
        return sum;
    }
    inline CUDA_CALLABLE int sign() const { return count == 0 ? 0 : (term[count - 1] > 0.0 ? 1 : -1); }
};

// ---------------------------------------------------------------- one triangle

struct Triangle {
    // Clip coordinates are float32 values; x and y are also kept times width and height, which is exact.
    double x[3], y[3], z[3], w[3], wide[3], high[3];
    double width, height;
    int orientation;  // sign of D; 0 covers nothing
    bool clipped;     // whether the near or far plane may cut it

    RASTER_FN double magnitude(double v) { return v < 0.0 ? -v : v; }
    RASTER_FN int sign_of(double v) { return (v > 0.0) - (v < 0.0); }
    // a b - c d, rounded once and a half (Kahan; Jeannerod, Louvet, Muller 2013).
    RASTER_FN double difference(double a, double b, double c, double d)
    {
        double cd = c * d;
        double error = ::fma(-c, d, cd);
        return ::fma(a, b, -cd) + error;
    }
    RASTER_FN double column(int width, int x) { return (double)(2 * x + 1 - width); }
    RASTER_FN double row(int height, int y) { return (double)(height - 2 * y - 1); }

    // `clip` has x, y, z, w of three vertices. Non-finite ones make a triangle that covers nothing.
    RASTER_FN void make(Triangle& t, const float* clip, int width, int height)
    {
        t.width = (double)(width);
        t.height = (double)(height);
        t.clipped = false;
        bool finite = true;
        for (int k = 0; k < 3; ++k) {
            t.x[k] = (double)(clip[4 * k]);
            t.y[k] = (double)(clip[4 * k + 1]);
            t.z[k] = (double)(clip[4 * k + 2]);
            t.w[k] = (double)(clip[4 * k + 3]);
            t.wide[k] = t.x[k] * t.width;
            t.high[k] = t.y[k] * t.height;
            t.clipped |= !(magnitude(t.z[k]) <= t.w[k]);
            double all = t.x[k] - t.x[k] + t.y[k] - t.y[k] + t.z[k] - t.z[k] + t.w[k] - t.w[k];
            finite &= all == 0.0;
        }
        t.orientation = finite ? orient(t) : 0;
    }

    // Exact sign of D. Products of two float32 values are exact in double.
    RASTER_FN int orient(const Triangle& t)
    {
        double sum = 0.0, size = 0.0;
        for (int k = 0; k < 3; ++k) {
            int i = (k + 1) % 3, j = (k + 2) % 3;
            double a = t.x[i] * t.y[j] * t.w[k], b = t.x[j] * t.y[i] * t.w[k];
            sum += a - b;
            size += magnitude(a) + magnitude(b);
        }
        if (magnitude(sum) > size * 0x1p-49)
            return sign_of(sum);
        Expansion exact;
        exact.count = 0;
        for (int k = 0; k < 3; ++k) {
            int i = (k + 1) % 3, j = (k + 2) % 3;
            exact.add(t.x[i] * t.y[j], t.w[k]);
            exact.add(-t.x[j] * t.y[i], t.w[k]);
        }
        return exact.sign();
    }

    // e_k at (a, b), and the size of what was subtracted: the value is wrong by at most 2^-50 of it. Vertices are
    // taken relative to the centre, one rounding each, so that no magnitude is lost near the edge.
    RASTER_FN double edge(const Triangle& t, int k, double a, double b, double& size)
    {
        int i = (k + 1) % 3, j = (k + 2) % 3;
        double xi = ::fma(-a, t.w[i], t.wide[i]), yi = ::fma(-b, t.w[i], t.high[i]);
        double xj = ::fma(-a, t.w[j], t.wide[j]), yj = ::fma(-b, t.w[j], t.high[j]);
        size = magnitude(xi * yj) + magnitude(xj * yi);
        return difference(xi, yj, xj, yi);
    }

    // Adds factor · e_k(a, b) without rounding; factor is a float32 value.
    RASTER_FN void add_edge(Expansion& sum, const Triangle& t, int k, double a, double b, double factor)
    {
        int i = (k + 1) % 3, j = (k + 2) % 3;
        double area = t.width * t.height, across = a * t.height, along = b * t.width;
        sum.add(t.x[i] * t.y[j], area, factor);
        sum.add(-t.x[j] * t.y[i], area, factor);
        sum.add(t.y[i] * t.w[j], across, factor);
        sum.add(-t.y[j] * t.w[i], across, factor);
        sum.add(t.x[j] * t.w[i], along, factor);
        sum.add(-t.x[i] * t.w[j], along, factor);
    }

    // Exact sign of e_k(a, b).
    RASTER_FN int edge_sign(const Triangle& t, int k, double a, double b)
    {
        double size;
        double e = edge(t, k, a, b, size);
        if (magnitude(e) > size * 0x1p-50)
            return sign_of(e);
        Expansion exact;
        exact.count = 0;
        add_edge(exact, t, k, a, b, 1.0);
        return exact.sign();
    }

    // Whether centres on edge k belong to this triangle: the edge is a left one, or a top one.
    RASTER_FN bool owns_edge(const Triangle& t, int k)
    {
        int i = (k + 1) % 3, j = (k + 2) % 3;
        int rightwards = t.orientation * sign_of(t.y[i] * t.w[j] - t.y[j] * t.w[i]);
        int upwards = t.orientation * sign_of(t.x[j] * t.w[i] - t.x[i] * t.w[j]);
        return rightwards > 0 || (rightwards == 0 && upwards < 0);
    }

    // Exact sign of w - side z at (a, b), times the sign of D: negative beyond the far (side 1) or near plane (-1).
    RASTER_FN int plane_sign(const Triangle& t, double a, double b, double side)
    {
        double sum = 0.0, size = 0.0;
        for (int k = 0; k < 3; ++k) {
            double edge_size;
            double e = edge(t, k, a, b, edge_size);
            double distance = t.w[k] - side * t.z[k];
            sum += e * distance;
            size += edge_size * magnitude(distance);
        }
        if (magnitude(sum) > size * 0x1p-48)
            return t.orientation * sign_of(sum);
        Expansion exact;
        exact.count = 0;
        for (int k = 0; k < 3; ++k) {
            add_edge(exact, t, k, a, b, t.w[k]);
            add_edge(exact, t, k, a, b, -side * t.z[k]);
        }
        return t.orientation * exact.sign();
    }

    // Whether the centre (a, b) is covered, exactly.
    RASTER_FN bool covers(const Triangle& t, double a, double b)
    {
        for (int k = 0; k < 3; ++k) {
            int side = t.orientation * edge_sign(t, k, a, b);
            if (side < 0 || (side == 0 && !owns_edge(t, k)))
                return false;
        }
        return !t.clipped || (plane_sign(t, a, b, 1.0) >= 0 && plane_sign(t, a, b, -1.0) >= 0);
    }

    // Narrows a rectangle of pixels to what the triangle may cover. X and Y are wrong by less than 2^-50 · 2^15.
    RASTER_FN void bound(const Triangle& t, int& x0, int& y0, int& x1, int& y1)
    {
        if (!(t.w[0] > 0.0 && t.w[1] > 0.0 && t.w[2] > 0.0))
            return;
        double r[3] = { 1.0 / t.w[0], 1.0 / t.w[1], 1.0 / t.w[2] };
        narrow(t.x, r, 0.5 * t.width, 0.5 * t.width - 0.5, x0, x1);
        narrow(t.y, r, -0.5 * t.height, 0.5 * t.height - 0.5, y0, y1);
    }
    RASTER_FN void narrow(const double* v, const double* r, double scale, double middle, int& first, int& last)
    {
        double low = 1e300, high = -1e300;
        for (int k = 0; k < 3; ++k) {
            double p = ::fma(v[k] * scale, r[k], middle);
            low = p < low ? p : low;
            high = p > high ? p : high;
        }
        low = ::ceil(low - 0x1p-34), high = ::floor(high + 0x1p-34);
        if (low > first)
            first = low > last ? last + 1 : (int)(low);
        if (high < last)
            last = high < first ? first - 1 : (int)(high);
    }

    // Edge functions at a covered centre, none of the wrong sign, to a relative 2^-40.
    RASTER_FN void weights(const Triangle& t, double a, double b, double* weight)
    {
        for (int k = 0; k < 3; ++k) {
            double size;
            double e = t.orientation * edge(t, k, a, b, size);
            if (!(e > size * 0x1p-10)) {
                Expansion exact;
                exact.count = 0;
                add_edge(exact, t, k, a, b, 1.0);
                e = t.orientation * exact.value();
            }
            weight[k] = e > 0.0 ? e : 0.0;
        }
    }

    // z / w at a covered centre. Where w changes its sign the sums may cancel: then they are made without rounding.
    RASTER_FN float depth(const Triangle& t, double a, double b)
    {
        double weight[3], z = 0.0, w = 0.0, size = 0.0;
        weights(t, a, b, weight);
        for (int k = 0; k < 3; ++k) {
            z += weight[k] * t.z[k];
            w += weight[k] * t.w[k];
            size += weight[k] * (magnitude(t.z[k]) + magnitude(t.w[k]));
        }
        if (!(w > size * 0x1p-8)) {
            Expansion exact_z, exact_w;
            exact_z.count = exact_w.count = 0;
            for (int k = 0; k < 3; ++k) {
                add_edge(exact_z, t, k, a, b, t.z[k]);
                add_edge(exact_w, t, k, a, b, t.w[k]);
            }
            z = exact_z.value(), w = exact_w.value();
        }
        double depth = w != 0.0 ? z / w : 0.0;
        return (float)(depth < -1.0 ? -1.0 : (depth > 1.0 ? 1.0 : depth)) + 0.0f;  // no -0, which is a smaller key
    }

    // Perspective-correct weights of vertices 1 and 2 at a covered centre.
    RASTER_FN void barycentrics(const Triangle& t, double a, double b, float& u, float& v)
    {
        double weight[3];
        weights(t, a, b, weight);
        double total = weight[0] + weight[1] + weight[2];
        double scale = total > 0.0 ? 1.0 / total : 0.0;
        u = (float)(weight[1] * scale);
        v = (float)(weight[2] * scale);
    }
};

// Triangles of one draw: clip positions, or points and the matrix that takes them there.
struct Mesh {
    const float* clip;
    const float* points;
    const double* matrix;
    const int* indices;
    int vertices;
    int first;  // number of its first face in the picture

    RASTER_FN void make(Mesh& m, const Task& task, int draw)
    {
        auto& d = task.meshes.data[task.mesh.data[draw]];
        m.clip = (const float*)(d.clip.data);
        m.points = (const float*)(d.points.data);
        m.matrix = (const double*)(task.matrices.data + draw);
        m.indices = d.indices.data;
        m.vertices = m.points ? d.points.shape[0] : d.clip.shape[0];
        m.first = task.first_face.data[draw];
    }

    // The end of a draw's faces in the picture.
    RASTER_FN int last(const Task& task, int draw)
    {
        return draw + 1 < task.first_face.shape[0] ? task.first_face.data[draw + 1] : 0x7fffffff;
    }

    // The draw that a face of the picture belongs to.
    RASTER_FN int owner(const Task& task, int face)
    {
        int low = 0, high = task.first_face.shape[0] - 1;
        while (low < high) {
            int middle = (low + high + 1) / 2;
            if (task.first_face.data[middle] <= face)
                low = middle;
            else
                high = middle - 1;
        }
        return low;
    }

    RASTER_FN bool in_range(const Mesh& m, int face)
    {
        const int* index = m.indices + 3 * (long long)(face);
        unsigned count = (unsigned)(m.vertices);
        return (unsigned)(index[0]) < count && (unsigned)(index[1]) < count && (unsigned)(index[2]) < count;
    }

    // Clip coordinates of a face's vertices: the operations of Corners::transform, so the same bits.
    RASTER_FN void triangle(const Mesh& m, int face, float* clip)
    {
        for (int k = 0; k < 3; ++k) {
            long long index = m.indices[3 * (long long)(face) + k];
            for (int c = 0; c < 4; ++c)
                clip[4 * k + c] = m.points ? coordinate(m.matrix + 4 * c, m.points + 3 * index) : m.clip[4 * index + c];
        }
    }
    RASTER_FN float coordinate(const double* q, const float* p)
    {
        double sum = ::fma(q[2], (double)(p[2]), q[3]);
        return (float)(::fma(q[0], (double)(p[0]), ::fma(q[1], (double)(p[1]), sum)));
    }
};

// ---------------------------------------------------------------- one thread, one triangle: CUDA

// The nearest fragment of a pixel is the smallest of 64-bit keys, depth above face.
struct Keyed {
    enum { LargeArea = 4096 };

    RASTER_FN unsigned long long key(float depth, int face)
    {
        union {
            float number;
            unsigned bits;
        } d;
        d.number = depth;
        // Bits that grow with the number, as unsigned integers.
        unsigned ordered = d.bits >> 31 ? ~d.bits : d.bits | 0x80000000u;
        return (unsigned long long)(ordered) << 32 | (unsigned)(face);
    }
    RASTER_FN float depth_of(unsigned long long key)
    {
        union {
            float number;
            unsigned bits;
        } d;
        unsigned ordered = (unsigned)(key >> 32);
        d.bits = ordered >> 31 ? ordered & 0x7fffffffu : ~ordered;
        return d.number;
    }
    RASTER_FN void nearest(unsigned long long* pixel, unsigned long long key)
    {
#ifdef __CUDA_ARCH__
        atomicMin(pixel, key);
#else
        *pixel = key < *pixel ? key : *pixel;
#endif
    }
    RASTER_FN int claim(int* counter)
    {
#ifdef __CUDA_ARCH__
        return atomicAdd(counter, 1);
#else
        return (*counter)++;
#endif
    }

    RASTER_FN bool make(Triangle& t, const Task& task, int face)
    {
        Mesh mesh;
        Mesh::make(mesh, task, Mesh::owner(task, face));
        if (!Mesh::in_range(mesh, face - mesh.first)) {
            task.faults.data[0] = face;
            return false;
        }
        float clip[12];
        Mesh::triangle(mesh, face - mesh.first, clip);
        Triangle::make(t, clip, task.width, task.height);
        return t.orientation != 0 && t.orientation != task.cull;
    }

    RASTER_FN void fragment(const Triangle& t, const Task& task, int face, int x, int y)
    {
        double a = Triangle::column(task.width, x), b = Triangle::row(task.height, y);
        if (Triangle::covers(t, a, b)) {
            auto* keys = (unsigned long long*)(task.keys.data);
            nearest(keys + (long long)(y) * task.width + x, key(Triangle::depth(t, a, b), face));
        }
    }

    // A triangle of few pixels; others wait in `entries` for draw_large.
    RASTER_FN void draw(const Task& task, int face)
    {
        Triangle t;
        if (!make(t, task, face))
            return;
        int x0 = 0, y0 = 0, x1 = task.width - 1, y1 = task.height - 1;
        Triangle::bound(t, x0, y0, x1, y1);
        if (x0 > x1 || y0 > y1)
            return;
        if ((long long)(x1 - x0 + 1) * (y1 - y0 + 1) > LargeArea) {
            int* record = task.entries.data + 3 * (long long)(claim(task.taken.data));
            record[0] = face;
            record[1] = x0 | x1 << 16;
            record[2] = y0 | y1 << 16;
            return;
        }
        for (int y = y0; y <= y1; ++y)
            for (int x = x0; x <= x1; ++x)
                fragment(t, task, face, x, y);
    }

    // All large triangles at one pixel.
    RASTER_FN void draw_large(const Task& task, int x, int y)
    {
        for (int i = 0; i < task.taken.data[0]; ++i) {
            const int* record = task.entries.data + 3 * (long long)(i);
            if (x < (record[1] & 0xffff) || x > record[1] >> 16 || y < (record[2] & 0xffff) || y > record[2] >> 16)
                continue;
            Triangle t;
            if (make(t, task, record[0]))
                fragment(t, task, record[0], x, y);
        }
    }

    RASTER_FN void finish(const Task& task, int x, int y)
    {
        long long pixel = (long long)(y) * task.width + x;
        unsigned long long key = ((const unsigned long long*)(task.keys.data))[pixel];
        bool deep = task.depth.data;
        task.face.data[pixel] = -1;
        if (deep)
            task.depth.data[pixel] = 1.0f;
        task.u.data[pixel] = task.v.data[pixel] = 0.0f;
        Triangle t;
        int face = (int)(key & 0xffffffffu);
        if (key == ~0ull || !make(t, task, face))
            return;
        task.face.data[pixel] = face;
        if (deep)
            task.depth.data[pixel] = depth_of(key);
        double a = Triangle::column(task.width, x), b = Triangle::row(task.height, y);
        Triangle::barycentrics(t, a, b, task.u.data[pixel], task.v.data[pixel]);
    }
};

// The painter's algorithm: triangles in the order of `task.order`, each over what is there already.
struct Painter {
    enum { BandRows = 16 };

    // By what triangles are sorted: z / w of the mean of the vertices' clip positions.
    RASTER_FN float depth(const Task& task, int face)
    {
        Triangle t;
        if (!Keyed::make(t, task, face))
            return 2.0f;
        double w = t.w[0] + t.w[1] + t.w[2];
        return w > 0.0 ? (float)((t.z[0] + t.z[1] + t.z[2]) / w) : 2.0f;
    }

    RASTER_FN void band(const Task& task, int band)
    {
        auto* keys = (unsigned long long*)(task.keys.data);
        for (int i = 0; i < task.order.shape[0]; ++i) {
            int face = task.order.data[i];
            Triangle t;
            if (!Keyed::make(t, task, face))
                continue;
            int x0 = 0, x1 = task.width - 1, y0 = BandRows * band, y1 = y0 + BandRows - 1;
            y1 = y1 < task.height ? y1 : task.height - 1;
            Triangle::bound(t, x0, y0, x1, y1);
            for (int y = y0; y <= y1; ++y)
                for (int x = x0; x <= x1; ++x) {
                    double a = Triangle::column(task.width, x), b = Triangle::row(task.height, y);
                    if (Triangle::covers(t, a, b))
                        keys[(long long)(y) * task.width + x] = Keyed::key(Triangle::depth(t, a, b), face);
                }
        }
    }
};

#ifndef __CUDACC__

// ---------------------------------------------------------------- eight pixels at once

typedef double Double8 __attribute__((ext_vector_type(8)));
typedef float Float8 __attribute__((ext_vector_type(8), aligned(4)));
typedef int Int8 __attribute__((ext_vector_type(8), aligned(4)));
typedef unsigned Unsigned8 __attribute__((ext_vector_type(8), aligned(4)));
typedef unsigned long long Keys8 __attribute__((ext_vector_type(8), aligned(8)));
typedef decltype(Double8() < Double8()) Long8;
typedef float Float4 __attribute__((ext_vector_type(4), aligned(4)));
typedef bool Bool8 __attribute__((ext_vector_type(8)));

struct Wide {
    RASTER_FN Double8 fma(Double8 a, Double8 b, Double8 c) { return __builtin_elementwise_fma(a, b, c); }
    // One instruction each; the builtins take three to keep NaNs out, which do not get here.
    RASTER_FN Double8 smaller(Double8 a, Double8 b) { return a < b ? a : b; }
    RASTER_FN Double8 larger(Double8 a, Double8 b) { return a > b ? a : b; }
    RASTER_FN Double8 exact(Float8 a) { return __builtin_convertvector(a, Double8); }
    RASTER_FN Double8 lanes() { return Double8 { 0, 1, 2, 3, 4, 5, 6, 7 }; }
    RASTER_FN int bits(Long8 mask)
    {
        Bool8 b = __builtin_convertvector(mask, Bool8);
        unsigned char bits;
        __builtin_memcpy(&bits, &b, 1);
        return bits;
    }
    RASTER_FN Int8 mask(int bits)
    {
        unsigned char byte = (unsigned char)(bits);
        Bool8 b;
        __builtin_memcpy(&b, &byte, 1);
        return -__builtin_convertvector(b, Int8);
    }
    // The chosen lanes side by side; eight numbers are written. A branch for each would be guessed wrong every other
    // time.
    RASTER_FN void pick(int* to, int lanes, Int8 value)
    {
#if defined(__AVX512VL__)
        typedef int Register __attribute__((vector_size(32)));
        Register picked = __builtin_ia32_compresssi256_mask((Register)(value), Register {}, (unsigned char)(lanes));
        *(Int8*)(to) = (Int8)(picked);
#else
        for (int lane = 0; lane < 8; ++lane) {
            *to = value[lane];
            to += lanes >> lane & 1;
        }
#endif
    }
    RASTER_FN void pick(unsigned long long* to, int lanes, Keys8 value)
    {
#if defined(__AVX512F__)
        typedef long long Register __attribute__((vector_size(64)));
        Register picked = __builtin_ia32_compressdi512_mask((Register)(value), Register {}, (unsigned char)(lanes));
        *(Keys8*)(to) = (Keys8)(picked);
#else
        for (int lane = 0; lane < 8; ++lane) {
            *to = value[lane];
            to += lanes >> lane & 1;
        }
#endif
    }
};

// c + a column + b row over a rectangle of pixels, columns and rows counted from its corner.
struct Linear {
    double a, b, c;
    double error;

    RASTER_FN double highest(const Linear& f, int columns, int rows)
    {
        return f.c + (f.a > 0.0 ? f.a * (columns - 1) : 0.0) + (f.b > 0.0 ? f.b * (rows - 1) : 0.0);
    }
};

// The pixels of a bin while it is drawn: a key each (see Keyed), which stays in the caches nearest to the thread. The
// nearer fragment stays, of equally near ones the smaller face: the order of drawing leaves no trace.
struct Target {
    unsigned long long* keys;
    int x0, y0, pitch;     // of the bin's first pixel in the picture; pixels in a row
    int width, height;     // of the picture

    RASTER_FN void write(const Target& target, int pixel, unsigned long long key)
    {
        unsigned long long old = target.keys[pixel];
        target.keys[pixel] = key < old ? key : old;
    }
    // Eight pixels from (x, y) of the picture on. Columns beyond the picture are drawn and never shown.
    RASTER_FN void write(const Target& target, int x, int y, int covered, Float8 z, int face)
    {
        Keys8* keys = (Keys8*)(target.keys + (y - target.y0) * target.pitch + (x - target.x0));
        z = __builtin_elementwise_min(__builtin_elementwise_max(z, Float8(-1.0f)), Float8(1.0f));
        Keys8 key = __builtin_convertvector(ordered(z), Keys8) << 32 | (unsigned long long)(face);
        Long8 chosen = __builtin_convertvector(Wide::mask(covered), Long8);
        *keys = chosen ? __builtin_elementwise_min(key, *keys) : *keys;
    }
    // Bits that grow with the number, as unsigned integers; -0 counts as 0.
    RASTER_FN Unsigned8 ordered(Float8 z)
    {
        z += 0.0f;
        Unsigned8 bits = *(const Unsigned8*)(&z);
        return z < 0.0f ? ~bits : bits | 0x80000000u;
    }
};

// A triangle over a rectangle of pixels [x0, x1] × [y0, y1]; columns count from `left`, a multiple of eight.
struct Fill {
    Linear edge[3];
    Linear depth;
    const Triangle* triangle;
    int face;
    int left, x0, y0, x1, y1;

    // False when an edge shows that no centre is covered.
    RASTER_FN bool make(Fill& f, const Triangle& t, int face, int x0, int y0, int x1, int y1)
    {
        f.triangle = &t;
        f.face = face;
        f.left = x0 & ~7;
        f.x0 = x0, f.y0 = y0, f.x1 = x1, f.y1 = y1;
        int columns = x1 - f.left + 8, rows = y1 - y0 + 1;
        double a = Triangle::column((int)(t.width), f.left), b = Triangle::row((int)(t.height), y0);
        double side = (double)(t.orientation);
        for (int k = 0; k < 3; ++k) {
            int i = (k + 1) % 3, j = (k + 2) % 3;
            double size;
            Linear& e = f.edge[k];
            e.c = side * Triangle::edge(t, k, a, b, size);
            e.a = 2.0 * side * Triangle::difference(t.high[i], t.w[j], t.high[j], t.w[i]);
            e.b = -2.0 * side * Triangle::difference(t.wide[j], t.w[i], t.wide[i], t.w[j]);
            e.error = 0x1p-49 * (size + Triangle::magnitude(e.a) * columns + Triangle::magnitude(e.b) * (rows + 8));
            if (Linear::highest(e, columns, rows) < -2.0 * e.error)
                return false;
        }
        make_depth(f);
        return true;
    }

    // Depth is linear on the screen. It is taken relative to a vertex, so that errors scale with the slope.
    RASTER_FN void make_depth(Fill& f)
    {
        const Triangle& t = *f.triangle;
        int m = t.w[0] > t.w[1] ? (t.w[0] > t.w[2] ? 0 : 2) : (t.w[1] > t.w[2] ? 1 : 2);
        double base = t.z[m] / t.w[m];
        if (!(Triangle::magnitude(base) <= 1.0))
            base = 0.0;
        double determinant = 0.0, lost = 0.0;
        double a = 0.0, b = 0.0, c = 0.0;
        for (int k = 0; k < 3; ++k) {
            double z = ::fma(-base, t.w[k], t.z[k]);
            a += f.edge[k].a * z;
            b += f.edge[k].b * z;
            c += f.edge[k].c * z;
            determinant += f.edge[k].c * t.w[k];
            lost += f.edge[k].error * (Triangle::magnitude(z) + 2.0 * Triangle::magnitude(t.w[k]));
        }
        double scale = 1.0 / determinant;
        f.depth.a = a * scale;
        f.depth.b = b * scale;
        f.depth.c = ::fma(c, scale, base);
        f.depth.error = determinant > 0.0 ? lost * scale + 0x1p-50 : 1.0;
    }

    RASTER_FN void draw(const Fill& f, const Target& target)
    {
        int first = (f.x0 - f.left) & ~7, segments = (f.x1 - f.left) / 8 + 1, rows = f.y1 - f.y0 + 1;
        if (segments * rows > 24)
            return draw_blocks(f, target);
        for (int row = 0; row < rows; ++row)
            for (int column = first; column < 8 * segments; column += 8)
                draw_segment(f, target, column, row, false);
    }

    // Blocks of 8×8 pixels, eight at a time: those beyond an edge are passed over, those within all three are not
    // tested again.
    RASTER_FN void draw_blocks(const Fill& f, const Target& target)
    {
        int columns = f.x1 - f.left + 1, rows = f.y1 - f.y0 + 1;
        for (int row = 0; row < rows; row += 8)
            for (int strip = 0; strip < columns; strip += 64) {
                Long8 some = Long8(-1), all = Long8(-1);
                for (int k = 0; k < 3; ++k) {
                    const Linear& e = f.edge[k];
                    double across = 7.0 * e.a, down = 7.0 * e.b;
                    double most = (across > 0.0 ? across : 0.0) + (down > 0.0 ? down : 0.0);
                    double least = (across < 0.0 ? across : 0.0) + (down < 0.0 ? down : 0.0);
                    Double8 column = Wide::lanes() * 8.0 + (double)(strip);
                    Double8 corner = Wide::fma(column, Double8(e.a), Double8(::fma((double)(row), e.b, e.c)));
                    some &= corner + most >= -4.0 * e.error;
                    all &= corner + least > 4.0 * e.error;
                }
                int touched = Wide::bits(some), inside = Wide::bits(all);
                int bottom = row + 8 < rows ? row + 8 : rows;
                for (int block = 0; block < 8; ++block) {
                    int column = strip + 8 * block;
                    if (!(touched >> block & 1) || column >= columns)
                        continue;
                    for (int y = row; y < bottom; ++y)
                        draw_segment(f, target, column, y, inside >> block & 1);
                }
            }
    }

    RASTER_FN void draw_segment(const Fill& f, const Target& target, int column, int row, bool inside)
    {
        Double8 across = Wide::lanes() + (double)(column);
        double down = (double)(row);
        int covered = 255, doubtful = 0;
        if (!inside) {
            Long8 sure = Long8(-1), possible = Long8(-1);
            for (int k = 0; k < 3; ++k) {
                const Linear& e = f.edge[k];
                Double8 value = Wide::fma(across, Double8(e.a), Double8(::fma(down, e.b, e.c)));
                sure &= value > e.error;
                possible &= value >= -e.error;
            }
            covered = Wide::bits(sure);
            doubtful = Wide::bits(possible) & ~covered;
            if (!(covered | doubtful))
                return;
        }
        // A needle's depth as a linear function may be lost in rounding: then each centre has its own.
        bool careful = !(f.depth.error <= 0x1p-28);
        Double8 z = Wide::fma(across, Double8(f.depth.a), Double8(::fma(down, f.depth.b, f.depth.c)));
        if (f.triangle->clipped) {
            Double8 past = __builtin_elementwise_abs(z) - 1.0;
            int within = careful ? 0 : Wide::bits(past < -f.depth.error);
            doubtful = (doubtful | (covered & ~within)) & (careful ? 255 : Wide::bits(past <= f.depth.error));
            covered &= within;
        }
        int x = f.left + column, y = f.y0 + row;
        double b = Triangle::row(target.height, y);
        for (; doubtful; doubtful &= doubtful - 1) {
            int lane = __builtin_ctz(doubtful);
            covered |= (int)(Triangle::covers(*f.triangle, Triangle::column(target.width, x + lane), b)) << lane;
        }
        if (!covered)
            return;
        Float8 depth = __builtin_convertvector(z, Float8);
        if (careful)
            for (int lane = 0; lane < 8; ++lane)
                if (covered >> lane & 1)
                    depth[lane] = Triangle::depth(*f.triangle, Triangle::column(target.width, x + lane), b);
        Target::write(target, x, y, covered, depth, f.face);
    }
};

// ---------------------------------------------------------------- bins

// A triangle that lies over many bins; corners in bins, x | y << 16.
struct Large {
    int face;
    unsigned low, high;
};

// Square bins of 2^shift pixels.
struct Bins {
    int shift, columns, rows, width, height;

    RASTER_FN void make(Bins& b, const Task& task)
    {
        b.shift = task.shift;
        b.width = task.width;
        b.height = task.height;
        b.columns = ((task.width - 1) >> task.shift) + 1;
        b.rows = ((task.height - 1) >> task.shift) + 1;
    }
};

// Clip coordinates of the vertices of eight triangles.
struct Corners {
    Float8 x[3], y[3], z[3], w[3];

    // Lanes that are not in `present` stay as they are. Returns the lanes whose indices are out of range.
    RASTER_FN int load(Corners& c, const Mesh& m, const int* face, int present)
    {
        Float4 corner[3][8];
        int faults = 0;
        for (int lane = 0; lane < 8; ++lane) {
            bool good = present >> lane & 1;
            if (good && !Mesh::in_range(m, face[lane])) {
                good = false;
                faults |= 1 << lane;
            }
            const int* index = m.indices + 3 * (long long)(good ? face[lane] : 0);
            for (int k = 0; k < 3; ++k)
                corner[k][lane] = good ? fetch(m, index[k]) : Float4(0.0f);
        }
        Int8 chosen = Wide::mask(present);
        for (int k = 0; k < 3; ++k) {
            Corners::Four loaded = transpose(corner[k]);
            if (m.points)
                transform(m, loaded);
            c.x[k] = chosen ? loaded.x : c.x[k];
            c.y[k] = chosen ? loaded.y : c.y[k];
            c.z[k] = chosen ? loaded.z : c.z[k];
            c.w[k] = chosen ? loaded.w : c.w[k];
        }
        return faults;
    }

    // One triangle in all lanes.
    RASTER_FN void load(Corners& c, const Mesh& m, int face)
    {
        float clip[12];
        Mesh::triangle(m, face, clip);
        for (int k = 0; k < 3; ++k) {
            c.x[k] = Float8(clip[4 * k]);
            c.y[k] = Float8(clip[4 * k + 1]);
            c.z[k] = Float8(clip[4 * k + 2]);
            c.w[k] = Float8(clip[4 * k + 3]);
        }
    }

    // A point, or a clip position as it is.
    RASTER_FN Float4 fetch(const Mesh& m, int index)
    {
        if (!m.points)
            return *(const Float4*)(m.clip + 4 * (long long)(index));
        const float* p = m.points + 3 * (long long)(index);
        return Float4 { p[0], p[1], p[2], 1.0f };
    }

    struct Four {
        Float8 x, y, z, w;
    };

    RASTER_FN Four transpose(const Float4* p)
    {
        Float8 q[4];
        for (int i = 0; i < 4; ++i)
            q[i] = __builtin_shufflevector(p[i], p[i + 4], 0, 1, 2, 3, 4, 5, 6, 7);
        Float8 xy = __builtin_shufflevector(q[0], q[1], 0, 8, 1, 9, 4, 12, 5, 13);
        Float8 zw = __builtin_shufflevector(q[0], q[1], 2, 10, 3, 11, 6, 14, 7, 15);
        Float8 xy2 = __builtin_shufflevector(q[2], q[3], 0, 8, 1, 9, 4, 12, 5, 13);
        Float8 zw2 = __builtin_shufflevector(q[2], q[3], 2, 10, 3, 11, 6, 14, 7, 15);
        return Four {
            __builtin_shufflevector(xy, xy2, 0, 1, 8, 9, 4, 5, 12, 13),
            __builtin_shufflevector(xy, xy2, 2, 3, 10, 11, 6, 7, 14, 15),
            __builtin_shufflevector(zw, zw2, 0, 1, 8, 9, 4, 5, 12, 13),
            __builtin_shufflevector(zw, zw2, 2, 3, 10, 11, 6, 7, 14, 15),
        };
    }

    RASTER_FN Float8 row(const double* q, Double8 x, Double8 y, Double8 z)
    {
        Double8 sum = Wide::fma(Double8(q[2]), z, Double8(q[3]));
        return __builtin_convertvector(Wide::fma(Double8(q[0]), x, Wide::fma(Double8(q[1]), y, sum)), Float8);
    }
    RASTER_FN void transform(const Mesh& m, Four& p)
    {
        Double8 x = Wide::exact(p.x), y = Wide::exact(p.y), z = Wide::exact(p.z);
        p = Four { row(m.matrix, x, y, z), row(m.matrix + 4, x, y, z), row(m.matrix + 8, x, y, z),
            row(m.matrix + 12, x, y, z) };
    }
};

// Eight triangles on their way to the screen. Bits of a mask are lanes.
struct Batch {
    Double8 x[3], y[3], z[3];  // columns, rows of pixel centres and depths of vertices, once projected
    Double8 w[3];
    Double8 low_x, low_y, high_x, high_y;  // pixels that a triangle may cover
    int alive, crossing, unclipped;        // may be seen; of them, across the eye plane; before it and not cut
    // Of the small ones: edge functions at the corner pixel (low_x, low_y), what a column and a row add to them, none
    // negative inside; twice the area, which is negative for front faces, for rows run downwards.
    enum { SmallSide = 8 };
    int small;
    Double8 edge[3], across[3], down[3], area;

    RASTER_FN Long8 all_beyond(const Double8* v, const Double8* w, double side)
    {
        return (v[0] * side > w[0]) & (v[1] * side > w[1]) & (v[2] * side > w[2]);
    }

    // Drops what is wholly outside one plane of the view volume, whatever the signs of w, or behind the eye.
    RASTER_FN void make(Batch& b, const Corners& corners, int present)
    {
        Double8 sum = {};
        Long8 unclipped = Long8(-1);
        for (int k = 0; k < 3; ++k) {
            b.x[k] = Wide::exact(corners.x[k]);
            b.y[k] = Wide::exact(corners.y[k]);
            b.z[k] = Wide::exact(corners.z[k]);
            b.w[k] = Wide::exact(corners.w[k]);
            sum += (b.x[k] - b.x[k]) + (b.y[k] - b.y[k]) + (b.z[k] - b.z[k]) + (b.w[k] - b.w[k]);
            unclipped &= __builtin_elementwise_abs(b.z[k]) <= b.w[k];
        }
        Long8 outside = all_beyond(b.x, b.w, 1.0) | all_beyond(b.x, b.w, -1.0) | all_beyond(b.y, b.w, 1.0)
            | all_beyond(b.y, b.w, -1.0) | all_beyond(b.z, b.w, 1.0) | all_beyond(b.z, b.w, -1.0);
        Double8 nearest = Wide::smaller(Wide::smaller(b.w[0], b.w[1]), b.w[2]);
        Double8 farthest = Wide::larger(Wide::larger(b.w[0], b.w[1]), b.w[2]);
        Long8 finite = sum == 0.0;
        b.alive = present & Wide::bits(~outside & finite & (farthest > 0.0));
        b.crossing = b.alive & Wide::bits(nearest <= 0.0);
        b.unclipped = b.alive & ~b.crossing & Wide::bits(unclipped);
    }

    // To pixels; drops what lies between centres. X and Y are wrong by less than 2^-50 · 2^15. Triangles across the
    // eye plane may cover the whole picture.
    RASTER_FN void project(Batch& b, double width, double height)
    {
        for (int k = 0; k < 3; ++k) {
            Double8 r = 1.0 / b.w[k];
            b.x[k] = Wide::fma(b.x[k] * (0.5 * width), r, Double8(0.5 * width - 0.5));
            b.y[k] = Wide::fma(b.y[k] * (-0.5 * height), r, Double8(0.5 * height - 0.5));
            b.z[k] *= r;
        }
        bound(b.x, width, b.low_x, b.high_x);
        bound(b.y, height, b.low_y, b.high_y);
        b.alive &= b.crossing | Wide::bits((b.low_x <= b.high_x) & (b.low_y <= b.high_y));
        Long8 before = __builtin_convertvector(~Wide::mask(b.crossing), Long8);
        b.low_x = before ? b.low_x : Double8(0.0), b.high_x = before ? b.high_x : Double8(width - 1.0);
        b.low_y = before ? b.low_y : Double8(0.0), b.high_y = before ? b.high_y : Double8(height - 1.0);
    }
    RASTER_FN void bound(const Double8* v, double size, Double8& low, Double8& high)
    {
        const double margin = 0x1p-34;
        low = __builtin_elementwise_ceil(Wide::smaller(Wide::smaller(v[0], v[1]), v[2]) - margin);
        high = __builtin_elementwise_floor(Wide::larger(Wide::larger(v[0], v[1]), v[2]) + margin);
        low = Wide::larger(low, Double8(0.0));
        high = Wide::smaller(high, Double8(size - 1.0));
    }

    // Which ones are small, and their edge functions; drops those of them that are culled.
    RASTER_FN void set_up(Batch& t, int cull)
    {
        Double8 x[3], y[3], reach = Double8(0.0);
        for (int k = 0; k < 3; ++k) {
            x[k] = t.x[k] - t.low_x, y[k] = t.y[k] - t.low_y;
            reach = Wide::larger(reach, __builtin_elementwise_abs(x[k]));
            reach = Wide::larger(reach, __builtin_elementwise_abs(y[k]));
        }
        for (int k = 0; k < 3; ++k) {
            int i = (k + 1) % 3, j = (k + 2) % 3;
            t.edge[k] = x[i] * y[j] - x[j] * y[i];
            t.across[k] = y[i] - y[j];
            t.down[k] = x[j] - x[i];
        }
        t.area = t.edge[0] + t.edge[1] + t.edge[2];
        Long8 little = (t.high_x - t.low_x < (double)(SmallSide)) & (t.high_y - t.low_y < (double)(SmallSide))
            & (reach < 32.0) & (__builtin_elementwise_abs(t.area) > 0x1p-16);
        t.small = t.alive & t.unclipped & Wide::bits(little);
        if (cull != 0) {
            int culled = t.small & Wide::bits(cull > 0 ? t.area < 0.0 : t.area > 0.0);
            t.small &= ~culled, t.alive &= ~culled;
        }
        Double8 side = t.area > 0.0 ? Double8(1.0) : Double8(-1.0);
        for (int k = 0; k < 3; ++k)
            t.edge[k] *= side, t.across[k] *= side, t.down[k] *= side;
    }
    // What an edge function of a small triangle is wrong by, at most: 2^-35 in its input, times 2 · 32 twice.
    RASTER_FN double doubt() { return 0x1p-28; }

    // Drops those over one or two pixel centres that cover none of them: of a fine mesh, most triangles.
    RASTER_FN void drop_empty(Batch& t)
    {
        Double8 columns = t.high_x - t.low_x, rows = t.high_y - t.low_y;
        Double8 first = Wide::smaller(Wide::smaller(t.edge[0], t.edge[1]), t.edge[2]);
        Double8 last = Double8(1e300);
        for (int k = 0; k < 3; ++k)
            last = Wide::smaller(last, Wide::fma(columns, t.across[k], Wide::fma(rows, t.down[k], t.edge[k])));
        t.alive &= ~(t.small & Wide::bits((columns + rows <= 1.0) & (Wide::larger(first, last) < -doubt())));
    }
};

// Sorts a chunk of triangles into bins: a bin has the numbers of those that may cover a pixel of it, the complements of
// the numbers of those that are not small.
struct Binner {
    enum { Chunk = 2048, Entries = 4 * Chunk, Room = Entries + 3 * Chunk, MostBins = 1024 };

    // Entries in the order of their triangles, eight more than are used.
    int where[Entries + 8];
    int face[Entries + 8];
    int counts[MostBins];
    int used, larges, fault, cull;
    Large* large;
    Bins bins;

    // Triangle `face` of the picture over bins [left, right] × [top, bottom].
    RASTER_FN void hand_over(Binner& s, int face, bool small, int left, int top, int right, int bottom)
    {
        if (right - left > 1 || bottom - top > 1) {
            Large& l = s.large[s.larges++];
            l.face = face;
            l.low = (unsigned)(left) | (unsigned)(top) << 16;
            l.high = (unsigned)(right) | (unsigned)(bottom) << 16;
            return;
        }
        for (int y = top; y <= bottom; ++y)
            for (int x = left; x <= right; ++x, ++s.used) {
                s.where[s.used] = y * s.bins.columns + x;
                s.face[s.used] = small ? face : ~face;
            }
    }

    // Eight faces of the mesh from `face` on; `count` of them exist.
    RASTER_FN void group(Binner& s, const Mesh& mesh, int face, int count)
    {
        int faces[8];
        for (int lane = 0; lane < 8; ++lane)
            faces[lane] = face + lane;
        Corners corners = {};
        int present = count < 8 ? (1 << count) - 1 : 255;
        int faults = Corners::load(corners, mesh, faces, present);
        if (faults) {
            s.fault = mesh.first + face + __builtin_ctz(faults);
            present &= ~faults;
        }
        Batch b;
        Batch::make(b, corners, present);
        if (!b.alive)
            return;
        Batch::project(b, (double)(s.bins.width), (double)(s.bins.height));
        Batch::set_up(b, s.cull);
        Batch::drop_empty(b);
        int shift = s.bins.shift;
        Int8 left = __builtin_convertvector(b.low_x, Int8) >> shift, right = __builtin_convertvector(b.high_x, Int8) >> shift;
        Int8 top = __builtin_convertvector(b.low_y, Int8) >> shift, bottom = __builtin_convertvector(b.high_y, Int8) >> shift;
        int within = b.alive & Wide::bits(__builtin_convertvector((left == right) & (top == bottom), Long8));
        Wide::pick(s.where + s.used, within, top * s.bins.columns + left);
        Int8 number = Int8 { 0, 1, 2, 3, 4, 5, 6, 7 } + (mesh.first + face);
        Wide::pick(s.face + s.used, within, Wide::mask(b.small) ? number : ~number);
        s.used += __builtin_popcount(within);
        for (int others = b.alive & ~within; others; others &= others - 1) {
            int lane = __builtin_ctz(others);
            bool small = b.small >> lane & 1;
            hand_over(s, mesh.first + face + lane, small, left[lane], top[lane], right[lane], bottom[lane]);
        }
    }

    RASTER_FN void run(const Task& task, int chunk)
    {
        const int* range = task.chunks.data + 3 * chunk;
        int* entries = task.entries.data + (long long)(Room) * chunk;
        Binner s;
        s.used = s.larges = 0;
        s.fault = -1;
        s.cull = task.cull;
        s.large = (Large*)(entries + Entries);
        Bins::make(s.bins, task);
        Mesh mesh;
        for (int draw = range[0], face = range[1], end = range[1] + range[2]; face < end; ++draw) {
            Mesh::make(mesh, task, draw);
            int last = Mesh::last(task, draw);
            last = last < end ? last : end;
            for (; face < last; face += 8)
                group(s, mesh, face - mesh.first, last - face);
            face = last;
        }
        sort(s, entries, task.starts.data + (long long)(s.bins.columns * s.bins.rows + 1) * chunk);
        task.large_counts.data[chunk] = s.larges;
        task.faults.data[chunk] = s.fault;
    }

    // Chunks one after the other, as long as there are any that no other thread has taken.
    RASTER_FN void run_all(const Task& task)
    {
        int chunk;
        while ((chunk = __atomic_fetch_add(task.taken.data, 1, __ATOMIC_RELAXED)) < task.chunks.shape[0])
            run(task, chunk);
    }

    // Entries in the order of their bins; bin b has [starts[b], starts[b + 1]).
    RASTER_FN void sort(Binner& s, int* entries, int* starts)
    {
        int bins = s.bins.columns * s.bins.rows, total = 0;
        for (int bin = 0; bin < bins; ++bin)
            s.counts[bin] = 0;
        for (int i = 0; i < s.used; ++i)
            ++s.counts[s.where[i]];
        for (int bin = 0; bin < bins; ++bin) {
            starts[bin] = total;
            total += s.counts[bin];
            s.counts[bin] = starts[bin];
        }
        starts[bins] = total;
        for (int i = 0; i < s.used; ++i)
            entries[s.counts[s.where[i]]++] = s.face[i];
    }
};

// ---------------------------------------------------------------- one bin of the picture

// Draws what the chunks left for a bin. Which arithmetic draws a triangle depends on nothing but the triangle and the
// picture's size, so that neither the order nor the company of triangles changes a bit.
struct Tile {
    enum { Fragments = 8 * Batch::SmallSide * Batch::SmallSide };

    Target target;
    Bins bins;
    int cull;            // -1, 0 or 1: the sign of D that is not drawn
    int column, row;     // of the bin
    int x0, y0, x1, y1;  // its pixels
    Mesh mesh;           // of the draw that was looked at last, whose faces are [mesh.first, last)
    int last;
    int waiting;         // faces of that mesh, to be drawn together
    int faces[8];
    // Fragments of eight small triangles, eight more than there can be.
    int where[Fragments + 8];
    unsigned long long keys[Fragments + 8];

    RASTER_FN void make(Tile& t, const Bins& bins, int bin, int cull, unsigned long long* keys)
    {
        int side = 1 << bins.shift;
        t.bins = bins;
        t.cull = cull;
        t.column = bin % bins.columns;
        t.row = bin / bins.columns;
        t.x0 = t.column * side, t.y0 = t.row * side;
        t.x1 = (t.x0 + side < bins.width ? t.x0 + side : bins.width) - 1;
        t.y1 = (t.y0 + side < bins.height ? t.y0 + side : bins.height) - 1;
        t.target.keys = keys;
        t.target.x0 = t.x0, t.target.y0 = t.y0, t.target.pitch = side;
        t.target.width = bins.width, t.target.height = bins.height;
        t.mesh.first = t.last = t.waiting = 0;
        for (int pixel = 0; pixel < side * (t.y1 - t.y0 + 1); ++pixel)
            keys[pixel] = ~0ull;
    }

    // Makes the mesh of a face of the picture the tile's.
    RASTER_FN void look_at(Tile& tile, const Task& task, int face)
    {
        if (face >= tile.mesh.first && face < tile.last)
            return;
        draw_waiting(tile);
        int draw = Mesh::owner(task, face);
        Mesh::make(tile.mesh, task, draw);
        tile.last = Mesh::last(task, draw);
    }

    RASTER_FN void draw(const Tile& tile, int face)
    {
        float clip[12];
        Triangle t;
        Mesh::triangle(tile.mesh, face - tile.mesh.first, clip);
        Triangle::make(t, clip, tile.bins.width, tile.bins.height);
        if (t.orientation == 0 || t.orientation == tile.cull)
            return;
        int x0 = tile.x0, y0 = tile.y0, x1 = tile.x1, y1 = tile.y1;
        Triangle::bound(t, x0, y0, x1, y1);
        Fill fill;
        if (x0 <= x1 && y0 <= y1 && Fill::make(fill, t, face, x0, y0, x1, y1))
            Fill::draw(fill, tile.target);
    }

    RASTER_FN void draw_entries(Tile& tile, const Task& task, const int* face, const int* end)
    {
        for (; face < end; ++face) {
            bool small = *face >= 0;
            int number = small ? *face : ~*face;
            look_at(tile, task, number);
            if (small)
                tile.faces[tile.waiting++] = number - tile.mesh.first;
            else
                draw(tile, number);
            if (tile.waiting == 8)
                draw_waiting(tile);
        }
    }

    RASTER_FN void draw_larges(Tile& tile, const Task& task, const Large* large, int count)
    {
        unsigned column = (unsigned)(tile.column), row = (unsigned)(tile.row);
        for (int i = 0; i < count; ++i) {
            const Large& l = large[i];
            if ((l.low & 0xffff) > column || (l.high & 0xffff) < column || l.low >> 16 > row || l.high >> 16 < row)
                continue;
            look_at(tile, task, l.face);
            draw(tile, l.face);
        }
    }

    // Small triangles together, a lane each.
    RASTER_FN void draw_waiting(Tile& tile)
    {
        if (!tile.waiting)
            return;
        Corners corners = {};
        int present = (1 << tile.waiting) - 1;
        for (; tile.waiting < 8; ++tile.waiting)
            tile.faces[tile.waiting] = 0;
        tile.waiting = 0;
        Corners::load(corners, tile.mesh, tile.faces, present);
        Batch b;
        Batch::make(b, corners, present);
        Batch::project(b, (double)(tile.bins.width), (double)(tile.bins.height));
        Batch::set_up(b, tile.cull);
        draw_small(tile, b);
    }

    RASTER_FN void draw_small(Tile& tile, const Batch& t)
    {
        if (!t.small)
            return;
        Double8 scale = 1.0 / __builtin_elementwise_abs(t.area);
        Double8 z1 = (t.z[1] - t.z[0]) * scale, z2 = (t.z[2] - t.z[0]) * scale;
        Double8 depth = Wide::fma(t.edge[1], z1, Wide::fma(t.edge[2], z2, t.z[0]));
        Double8 depth_a = Wide::fma(t.across[1], z1, t.across[2] * z2);
        Double8 depth_b = Wide::fma(t.down[1], z1, t.down[2] * z2);

        // Columns and rows of the box that lie in the tile, counted from the corner pixel.
        Double8 left = Wide::larger((double)(tile.x0) - t.low_x, Double8(0.0));
        Double8 top = Wide::larger((double)(tile.y0) - t.low_y, Double8(0.0));
        Double8 columns = Wide::smaller(t.high_x, Double8((double)(tile.x1))) - t.low_x + 1.0 - left;
        Double8 rows = Wide::smaller(t.high_y, Double8((double)(tile.y1))) - t.low_y + 1.0 - top;
        Int8 x0 = __builtin_convertvector(t.low_x + left, Int8), y0 = __builtin_convertvector(t.low_y + top, Int8);
        Int8 first = (y0 - tile.y0) * tile.target.pitch + (x0 - tile.x0);
        Long8 chosen = __builtin_convertvector(Wide::mask(t.small), Long8);
        int most_columns = (int)(__builtin_reduce_max(chosen ? columns : Double8(0.0)));
        int most_rows = (int)(__builtin_reduce_max(chosen ? rows : Double8(0.0)));
        Keys8 face = __builtin_convertvector(*(const Int8*)(tile.faces) + tile.mesh.first, Keys8);
        int used = 0;
        for (int row = 0; row < most_rows; ++row) {
            Double8 j = top + (double)(row);
            Double8 e[3];
            for (int k = 0; k < 3; ++k)
                e[k] = Wide::fma(j, t.down[k], t.edge[k]);
            Double8 depth_row = Wide::fma(j, depth_b, depth);
            int reached = t.small & Wide::bits((double)(row) < rows);
            for (int column = 0; column < most_columns; ++column) {
                Double8 i = left + (double)(column);
                Double8 least = Wide::smaller(Wide::fma(i, t.across[0], e[0]), Wide::fma(i, t.across[1], e[1]));
                least = Wide::smaller(least, Wide::fma(i, t.across[2], e[2]));
                int here = reached & Wide::bits((double)(column) < columns);
                int covered = here & Wide::bits(least > Batch::doubt());
                int doubtful = here & ~covered & Wide::bits(least > -Batch::doubt());
                for (; doubtful; doubtful &= doubtful - 1) {
                    int lane = __builtin_ctz(doubtful);
                    covered |= (int)(covers(tile, tile.faces[lane], x0[lane] + column, y0[lane] + row)) << lane;
                }
                Double8 precise = Wide::fma(i, depth_a, depth_row);
                precise = Wide::smaller(Wide::larger(precise, Double8(-1.0)), Double8(1.0));
                Unsigned8 ordered = Target::ordered(__builtin_convertvector(precise, Float8));
                Wide::pick(tile.where + used, covered, first + (row * tile.target.pitch + column));
                Wide::pick(tile.keys + used, covered, __builtin_convertvector(ordered, Keys8) << 32 | face);
                used += __builtin_popcount(covered);
            }
        }
        for (int i = 0; i < used; ++i)
            Target::write(tile.target, tile.where[i], tile.keys[i]);
    }

    RASTER_FN bool covers(const Tile& tile, int face, int x, int y)
    {
        float clip[12];
        Triangle t;
        Mesh::triangle(tile.mesh, face, clip);
        Triangle::make(t, clip, tile.bins.width, tile.bins.height);
        return t.orientation != 0
            && Triangle::covers(t, Triangle::column(tile.bins.width, x), Triangle::row(tile.bins.height, y));
    }

    // The picture as users have it: misses marked, and perspective-correct barycentrics of the faces that are left.
    RASTER_FN void finish(const Tile& tile, const Task& task)
    {
        for (int y = tile.y0; y <= tile.y1; ++y) {
            const Keys8* keys = (const Keys8*)(tile.target.keys + (y - tile.y0) * tile.target.pitch);
            for (int x = tile.x0; x <= tile.x1; x += 8, ++keys) {
                long long pixel = (long long)(y) * task.width + x;
                int count = task.width - x;
                Float8 u = Float8(0.0f), v = Float8(0.0f);
                Long8 seen = *keys != ~0ull;
                int hits = Wide::bits(seen) & (count < 8 ? (1 << count) - 1 : 255);
                Int8 face = __builtin_convertvector(*keys, Int8);
                if (hits)
                    barycentrics(task, x, y, face, hits, u, v);
                Int8 hit = Wide::mask(hits);
                store((float*)(task.face.data) + pixel, *(Float8*)(&face), count);
                if (task.depth.data)
                    store(task.depth.data + pixel, hit ? depth_of(*keys) : Float8(1.0f), count);
                store(task.u.data + pixel, hit ? u : Float8(0.0f), count);
                store(task.v.data + pixel, hit ? v : Float8(0.0f), count);
            }
        }
    }

    // The inverse of Target::ordered.
    RASTER_FN Float8 depth_of(Keys8 keys)
    {
        Unsigned8 bits = __builtin_convertvector(keys >> 32, Unsigned8);
        bits = (Int8)(bits) < 0 ? bits & 0x7fffffffu : ~bits;
        return *(const Float8*)(&bits);
    }

    // The first `count` of eight numbers. Past the caches where the address allows: they are not read here again.
    RASTER_FN void store(float* to, Float8 value, int count)
    {
        typedef float Aligned __attribute__((ext_vector_type(8)));
        if (count >= 8 && (unsigned long long)(to) % sizeof(Aligned) == 0)
            __builtin_nontemporal_store((Aligned)(value), (Aligned*)(to));
        else
            for (int lane = 0; lane < 8 && lane < count; ++lane)
                to[lane] = value[lane];
    }

    // Of eight pixels from (x, y) on, where `hits` says so.
    RASTER_FN void barycentrics(const Task& task, int x, int y, Int8 face, int hits, Float8& u, Float8& v)
    {
        Corners corners = {};
        int faces[8], wanted = hits;
        *(Int8*)(faces) = face;
        int common = faces[__builtin_ctz(hits)];
        if (!(hits & ~Wide::bits(__builtin_convertvector(face == common, Long8)))) {
            Mesh mesh;
            Mesh::make(mesh, task, Mesh::owner(task, common));
            Corners::load(corners, mesh, common - mesh.first);
            hits = 0;
        }
        while (hits) {
            int draw = Mesh::owner(task, faces[__builtin_ctz(hits)]);
            Mesh mesh;
            Mesh::make(mesh, task, draw);
            int last = Mesh::last(task, draw), local[8], same = 0;
            for (int lane = 0; lane < 8; ++lane) {
                local[lane] = faces[lane] - mesh.first;
                same |= (int)(faces[lane] >= mesh.first && faces[lane] < last) << lane;
            }
            same &= hits;
            Corners::load(corners, mesh, local, same);
            hits &= ~same;
        }
        double width = (double)(task.width), height = (double)(task.height);
        Double8 a = 2.0 * (Wide::lanes() + (double)(x)) + (1.0 - width);
        Double8 b = Double8(height - 2.0 * y - 1.0);
        Double8 dx[3], dy[3], e[3];
        for (int k = 0; k < 3; ++k) {
            Double8 w = Wide::exact(corners.w[k]);
            dx[k] = Wide::fma(-a, w, Wide::exact(corners.x[k]) * width);
            dy[k] = Wide::fma(-b, w, Wide::exact(corners.y[k]) * height);
        }
        Double8 size = Double8(0.0);
        for (int k = 0; k < 3; ++k) {
            int i = (k + 1) % 3, j = (k + 2) % 3;
            Double8 product = dx[j] * dy[i];
            e[k] = Wide::fma(dx[i], dy[j], -product) + Wide::fma(-dx[j], dy[i], product);
            size += __builtin_elementwise_abs(product) + __builtin_elementwise_abs(dx[i] * dy[j]);
        }
        Double8 total = e[0] + e[1] + e[2];
        int unsure = wanted & Wide::bits(__builtin_elementwise_abs(total) <= size * 0x1p-26);
        Double8 scale = total != 0.0 ? 1.0 / total : Double8(0.0);
        Double8 first = Wide::smaller(Wide::larger(e[1] * scale, Double8(0.0)), Double8(1.0));
        Double8 second = Wide::smaller(Wide::larger(e[2] * scale, Double8(0.0)), 1.0 - first);
        u = __builtin_convertvector(first, Float8);
        v = __builtin_convertvector(second, Float8);
        // Needles: each centre by itself, with exact sums where they are called for.
        for (; unsure; unsure &= unsure - 1) {
            int lane = __builtin_ctz(unsure);
            Triangle t;
            Keyed::make(t, task, faces[lane]);
            float exact_u, exact_v;
            Triangle::barycentrics(t, a[lane], b[lane], exact_u, exact_v);
            u[lane] = exact_u, v[lane] = exact_v;
        }
    }

    RASTER_FN void run(const Task& task, int bin, unsigned long long* keys)
    {
        Bins bins;
        Bins::make(bins, task);
        Tile tile;
        make(tile, bins, bin, task.cull, keys);
        int bin_count = bins.columns * bins.rows;
        for (int chunk = 0; chunk < task.chunks.shape[0]; ++chunk) {
            const int* starts = task.starts.data + (long long)(bin_count + 1) * chunk + bin;
            const int* entries = task.entries.data + (long long)(Binner::Room) * chunk;
            draw_entries(tile, task, entries + starts[0], entries + starts[1]);
            draw_larges(tile, task, (const Large*)(entries + Binner::Entries), task.large_counts.data[chunk]);
        }
        draw_waiting(tile);
        finish(tile, task);
    }

    // Bins one after the other, as long as there are any that no other thread has taken.
    RASTER_FN void run_all(const Task& task, int worker)
    {
        Bins bins;
        Bins::make(bins, task);
        auto* keys = (unsigned long long*)(task.keys.data) + ((long long)(worker) << 2 * task.shift);
        int bin;
        while ((bin = __atomic_fetch_add(task.taken.data + 1, 1, __ATOMIC_RELAXED)) < bins.columns * bins.rows)
            run(task, bin, keys);
    }
};

#endif
