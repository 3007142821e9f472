// Watertight ray traversal over the trees that Warp builds: closest hit, any hit, resume after a hit.
//
// The rule of the whole file: a ray's answer is the smallest (t, instance, face) among all triangles that pass the
// leaf test, whatever the shape of the tree and the order of the walk. Boxes are never culled on a tie, nor within
// the rounding error of t.
//
// WR_SCALAR chooses the scalar form, on CUDA always and on the CPU for tests. With WR_FAST, Warp's own query answers
// for each mesh, and the rule does not hold.
//
// native.py pastes this text into the body of the functions that need it, so it holds only what C++ allows inside
// a function: types, and structs with static members. Warp defines float(x) and int(x) as macros, so casts are
// written (float)(x).
//
//   Bound, Lane, Answer        numbers; a ray made ready; what it has found so far
//   Triangle, Sphere           leaves
//   Plain                      Warp's own query, to compare with
//   Binary                     scalar walk over Warp's binary tree (CUDA, and any CPU)
//   Wide                       the same walk over eight boxes and four triangles at once
//   Stream, Group              many rays: eight walks in turn; sixteen coherent rays as one
//
// Sources: Woop, Benthin, Wald, "Watertight Ray/Triangle Intersection", JCGT 2(1), 2013 (leaf); Ize, "Robust BVH Ray
// Traversal", JCGT 2(2), 2013 and pbrt-v4 6.8.2 (boxes); Ernst, Greiner, "Multi bounding volume hierarchies", 2008
// and Wald, Benthin, Boulos, "Getting Rid of Packets", 2008 (wide nodes); Boulos, Wald, Shirley, "Geometric and
// Arithmetic Culling Methods for Entire Ray Packets", 2006 (groups by interval arithmetic).

#define WR_FN static inline CUDA_CALLABLE
// One copy of a walk for all calls of it: inlined, CUDA compiles for minutes, and on the CPU what calls it grows too
// large to be inlined itself, so that whole scenes are copied for each ray.
#ifdef __CUDA_ARCH__
#define WR_WALK static __noinline__ CUDA_CALLABLE
#else
#define WR_WALK static __attribute__((noinline))
#endif
#ifdef __CUDA_ARCH__
#define WR_SCALAR
#define WR_NO_FUSION
#else
#define WR_NO_FUSION _Pragma("clang fp contract(off)")
#endif

// ---------------------------------------------------------------- numbers

struct Bound {
    // gamma(n) = n u / (1 - n u), u = 2^-24: n roundings in a row err by at most this factor (pbrt-v4 6.8.1).
    WR_FN float gamma(int n)
    {
        double u = n * 0x1p-24;
        return (float)(u / (1.0 - u));
    }
    // Either side of the slab test rounds three times (Ize; pbrt-v4 6.8.2).
    WR_FN float slab() { return 1.0f + 2.0f * gamma(3); }
    WR_FN float infinity() { return INFINITY; }
    WR_FN float magnitude(float x) { return x < 0.0f ? -x : x; }
    WR_FN float larger(float a, float b) { return a > b ? a : b; }
    WR_FN float smaller(float a, float b) { return a < b ? a : b; }
    WR_FN float largest(const float* a) { return larger(larger(a[0], a[1]), a[2]); }
    WR_FN float smallest(const float* a) { return smaller(smaller(a[0], a[1]), a[2]); }
    WR_FN float extreme(const float* a) { return larger(larger(magnitude(a[0]), magnitude(a[1])), magnitude(a[2])); }
    // Unfused: a contracted a * b - c * d is not antisymmetric, and two triangles would disagree on their edge.
    WR_FN float product(float a, float b)
    {
        WR_NO_FUSION
#ifdef __CUDA_ARCH__
        return __fmul_rn(a, b);
#else
        return a * b;
#endif
    }
    WR_FN float sum(float a, float b)
    {
        WR_NO_FUSION
#ifdef __CUDA_ARCH__
        return __fadd_rn(a, b);
#else
        return a + b;
#endif
    }
};

// A ray made ready for boxes and for Woop's sheared triangles.
struct Lane {
    float o[3], d[3];
    float r[3];        // 1 / d, infinite where d is zero
    float unit;        // the caller's t is this ray's t times unit, a power of two
    int kx, ky, kz;    // kz: the axis along which d is largest
    float sx, sy, sz;  // shear

    // The largest component of the direction, 0 for rays that cannot hit anything: a zero or non-finite direction, a
    // non-finite origin.
    WR_FN float set(Lane& ray, const float* origin, const float* direction)
    {
        float check = 0.0f;
        for (int k = 0; k < 3; ++k) {
            ray.o[k] = origin[k];
            ray.d[k] = direction[k];
            check += (origin[k] - origin[k]) + (direction[k] - direction[k]);
        }
        float m = Bound::extreme(ray.d);
        if (!(check == 0.0f && m > 0.0f))
            return 0.0f;
        // Very long and very short directions would leave float32's range in products.
        ray.unit = m < 0x1p-60f ? 0x1p80f : (m > 0x1p60f ? 0x1p-80f : 1.0f);
        for (int k = 0; k < 3; ++k)
            ray.d[k] *= ray.unit;
        return m * ray.unit;
    }
    WR_FN bool make(Lane& ray, const float* origin, const float* direction)
    {
        float m = set(ray, origin, direction);
        if (m > 0.0f)
            finish(ray, m);
        return m > 0.0f;
    }
    WR_FN void finish(Lane& ray, float m)
    {
        shear(ray, m);
        for (int k = 0; k < 3; ++k)
            ray.r[k] = 1.0f / ray.d[k];
    }
    // All that triangles need.
    WR_FN void shear(Lane& ray, float m)
    {
        // Less than 1e-30 of the largest moves no point within float32's range by half an ulp, but its reciprocal
        // may overflow.
        for (int k = 0; k < 3; ++k)
            if (Bound::magnitude(ray.d[k]) < 1.0e-30f * m)
                ray.d[k] = 0.0f;
        float a[3] = { Bound::magnitude(ray.d[0]), Bound::magnitude(ray.d[1]), Bound::magnitude(ray.d[2]) };
        ray.kz = a[2] >= a[0] && a[2] >= a[1] ? 2 : (a[1] >= a[0] ? 1 : 0);
        ray.kx = ray.kz == 2 ? 0 : ray.kz + 1;
        ray.ky = ray.kx == 2 ? 0 : ray.kx + 1;
        ray.sx = ray.d[ray.kx] / ray.d[ray.kz];
        ray.sy = ray.d[ray.ky] / ray.d[ray.kz];
        ray.sz = 1.0f / ray.d[ray.kz];
    }
};

// What a ray has found so far, and what it still wants.
struct Answer {
    float t;          // t_end until something is hit
    float t_end;      // only 0 <= t < t_end counts
    float t_cull;     // boxes that start beyond cannot matter: t plus its error bound
    int instance, face;
    float u, v;       // weights of vertices 1 and 2
    float t_after;    // only what comes after (t_after, instance_after, face_after) counts
    int instance_after, face_after;

    WR_FN bool before(float t, int i, int f, float t2, int i2, int f2)
    {
        return t != t2 ? t < t2 : (i != i2 ? i < i2 : f < f2);
    }
    CUDA_CALLABLE inline bool found() const { return face >= 0; }
    CUDA_CALLABLE inline bool wants(float t_new, int i, int f) const
    {
        return before(t_new, i, f, t, instance, face)
            && before(t_after, instance_after, face_after, t_new, i, f);
    }
    // Rounding may have moved t across an end of the interval.
    CUDA_CALLABLE inline bool near_end(float t_new, float error) const
    {
        return Bound::magnitude(t_new) <= error || Bound::magnitude(t_new - t_end) <= error;
    }
    CUDA_CALLABLE inline void take(float t_new, float error, int i, int f, float u_new, float v_new)
    {
        t = t_new;
        t_cull = (t_new + error) * (1.0f + 2.0f * Bound::gamma(3));
        instance = i;
        face = f;
        u = u_new;
        v = v_new;
    }
    WR_FN Answer open(const Lane& ray, float t_max, float t_after, int instance_after, int face_after)
    {
        // A distance that float32 cannot hold in the caller's units is no hit.
        float t = Bound::smaller(ray.unit > 1.0f ? 0x1p48f : Bound::infinity(), t_max / ray.unit);
        return { t, t, t * (1.0f + 2.0f * Bound::gamma(8)), -1, -1, 0.0f, 0.0f, t_after / ray.unit, instance_after,
            face_after };
    }
    CUDA_CALLABLE inline float distance(const Lane& ray) const { return found() ? t * ray.unit : Bound::infinity(); }
};

// ---------------------------------------------------------------- leaves

struct Triangle {
    // Sheared coordinates of one vertex relative to the ray; z is its depth in units of t.
    WR_FN void project(const Lane& ray, const float* p, float& x, float& y, float& z)
    {
        float c = Bound::sum(p[ray.kz], -ray.o[ray.kz]);
        x = Bound::sum(Bound::sum(p[ray.kx], -ray.o[ray.kx]), -Bound::product(ray.sx, c));
        y = Bound::sum(Bound::sum(p[ray.ky], -ray.o[ray.ky]), -Bound::product(ray.sy, c));
        z = Bound::product(ray.sz, c);
    }
    // Each vertex's weight times det. Rounding is monotone, so a sign is right or rounded to zero; products of two
    // float32 are exact in float64, which then tells (Woop, section 3.2).
    WR_FN void edges(const float* x, const float* y, float* e)
    {
        bool unsure = false;
        for (int k = 0; k < 3; ++k) {
            int i = (k + 2) % 3, j = (k + 1) % 3;
            e[k] = Bound::sum(Bound::product(x[i], y[j]), -Bound::product(y[i], x[j]));
            unsure |= e[k] == 0.0f;
        }
        for (int k = 0; k < 3 && unsure; ++k) {
            int i = (k + 2) % 3, j = (k + 1) % 3;
            double p = (double)(x[i]) * (double)(y[j]), q = (double)(y[i]) * (double)(x[j]);
            e[k] = (float)(p - q);
        }
    }
    // How far the computed t may lie from the true one (after pbrt-v4 6.8.7). The vertices err by the shear's
    // roundings, the weights by those of the edges; weights that sum to 1 move t by no more than the depths' spread.
    WR_FN float error(const Lane& ray, const float* x, const float* y, const float* z, float inverse)
    {
        float mx = Bound::extreme(x), my = Bound::extreme(y), mz = Bound::extreme(z);
        float depth = mz * Bound::magnitude(ray.d[ray.kz]);
        float dx = Bound::gamma(5) * (mx + depth), dy = Bound::gamma(5) * (my + depth);
        float edge = Bound::gamma(2) * mx * my + dy * mx + dx * my + dx * dy;
        float weight = Bound::smaller(16.0f * edge * Bound::magnitude(inverse), 1.0f);
        return mz * Bound::gamma(8) + weight * (Bound::largest(z) - Bound::smallest(z));
    }
    // Where the ray meets the triangle's plane, in float64: on which side of it the origin lies, all but exactly.
    WR_FN double depth(const Lane& ray, const float p[3][3])
    {
        double a[3], b[3], c[3];
        for (int k = 0; k < 3; ++k) {
            a[k] = (double)(p[1][k]) - (double)(p[0][k]);
            b[k] = (double)(p[2][k]) - (double)(p[0][k]);
            c[k] = (double)(p[0][k]) - (double)(ray.o[k]);
        }
        double n[3] = { a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0] };
        return (n[0] * c[0] + n[1] * c[1] + n[2] * c[2]) / (n[0] * ray.d[0] + n[1] * ray.d[1] + n[2] * ray.d[2]);
    }
    // A ray through the triangle's inside has it if t is wanted; within t's error of an end float64 decides.
    WR_FN bool settle(const Lane& ray, const float p[3][3], float t, float error, float w1, float w2, int instance,
        int face, Answer& best)
    {
        if (best.near_end(t, error)) {
            double exact = depth(ray, p);
            if (!(exact >= 0.0 && exact < (double)(best.t_end)))
                return false;
            t = (float)(exact);
        }
        if (!(t >= 0.0f && best.wants(t, instance, face)))
            return false;
        best.take(t, error, instance, face, w1, w2);
        return true;
    }
    // Offers a triangle to the answer; true if it was taken.
    WR_FN bool offer(const Lane& ray, const float p[3][3], int instance, int face, Answer& best)
    {
        float x[3], y[3], z[3], e[3];
        for (int k = 0; k < 3; ++k)
            project(ray, p[k], x[k], y[k], z[k]);
        edges(x, y, e);
        if (Bound::smallest(e) < 0.0f && Bound::largest(e) > 0.0f)
            return false;
        float det = Bound::sum(Bound::sum(e[0], e[1]), e[2]);
        if (!(det != 0.0f))
            return false;
        float inverse = 1.0f / det;
        float w1 = e[1] * inverse, w2 = e[2] * inverse;
        float t = Bound::sum(z[0], Bound::product(w1, Bound::sum(z[1], -z[0])));
        t = Bound::sum(t, Bound::product(w2, Bound::sum(z[2], -z[0])));
        return settle(ray, p, t, error(ray, x, y, z, inverse), w1, w2, instance, face, best);
    }
};

struct Sphere {
    // A sphere about the origin. Distance of the line from the centre by the perpendicular vector, not by the
    // discriminant, which cancels (Haines, Guenther, Akenine-Moeller, Ray Tracing Gems, chapter 7), in float64.
    WR_FN bool offer(const Lane& ray, float radius, int instance, Answer& best)
    {
        double a = 0.0, b = 0.0, oo = 0.0, qq = 0.0, r = radius;
        for (int k = 0; k < 3; ++k) {
            a += (double)(ray.d[k]) * ray.d[k];
            b -= (double)(ray.d[k]) * ray.o[k];
            oo += (double)(ray.o[k]) * ray.o[k];
        }
        for (int k = 0; k < 3; ++k) {
            double q = ray.o[k] + b / a * ray.d[k];
            qq += q * q;
        }
        double rest = r * r - qq;
        if (!(rest >= 0.0))
            return false;
        double root = wp::sqrt(a * rest), far = b < 0.0 ? b - root : b + root;
        double t0 = far == 0.0 ? 0.0 : (oo - r * r) / far, t1 = far / a;
        return take((float)(t0 < t1 ? t0 : t1), instance, best) || take((float)(t0 < t1 ? t1 : t0), instance, best);
    }
    WR_FN bool take(float t, int instance, Answer& best)
    {
        if (!(t >= 0.0f && best.wants(t, instance, 0)))
            return false;
        best.take(t, t * Bound::gamma(1), instance, 0, 0.0f, 0.0f);
        return true;
    }
};

// ---------------------------------------------------------------- Warp's own query

struct Plain {
    // wp.mesh_query_ray as it comes: not watertight. It has no lower end, so a ray that goes on starts behind its hit.
    WR_FN void offer(wp::uint64 mesh, int instance, const Lane& ray, Answer& best)
    {
        float begin = best.t_after < 0.0f ? 0.0f : best.t_after * (1.0f + 0x1p-20f), t, u, v, sign;
        wp::vec3 d(ray.d[0], ray.d[1], ray.d[2]), normal;
        wp::vec3 o(ray.o[0] + begin * d[0], ray.o[1] + begin * d[1], ray.o[2] + begin * d[2]);
        int face;
        if (!wp::mesh_query_ray(mesh, o, d, best.t - begin, t, u, v, sign, normal, face))
            return;
        // Its u and v weigh vertices 0 and 1.
        if (best.wants(begin + t, instance, face))
            best.take(begin + t, 0.0f, instance, face, v, 1.0f - u - v);
    }
};

// ---------------------------------------------------------------- scalar walk over Warp's binary tree

struct Binary {
    enum { depth = 64 };  // Warp's trees end at depth 31

    // Where the ray enters a box, or -1. The origin may be off by pad. Comparisons keep the other operand when
    // 0 * inf made NaN: the ray runs within that plane, which counts as inside.
    WR_FN float enter(const wp::BVH& tree, int node, const Lane& ray, float pad, float t_cull)
    {
        wp::BVHPackedNodeHalf a = wp::bvh_load_node(tree.node_lowers, node);
        wp::BVHPackedNodeHalf b = wp::bvh_load_node(tree.node_uppers, node);
        float lo[3] = { a.x, a.y, a.z }, hi[3] = { b.x, b.y, b.z };
        return slab(lo, hi, ray, pad, t_cull);
    }
    WR_FN float slab(const float* lo, const float* hi, const Lane& ray, float pad, float t_cull)
    {
        float near = 0.0f, far = t_cull;
        for (int k = 0; k < 3; ++k) {
            bool down = ray.r[k] < 0.0f;
            float l = (lo[k] - (ray.o[k] + pad)) * ray.r[k], h = (hi[k] - (ray.o[k] - pad)) * ray.r[k];
            near = Bound::larger(down ? h : l, near);
            far = Bound::smaller(down ? l : h, far);
        }
        return near <= far * Bound::slab() ? near : -1.0f;
    }

    struct Walk {
        int node[depth];
        float near[depth];
        int count;

        CUDA_CALLABLE inline void push(int n, float t)
        {
            node[count] = n;
            near[count++] = t;
        }
        // The next node that may matter, or -1.
        CUDA_CALLABLE inline int pop(float t_cull)
        {
            while (count)
                if (near[--count] <= t_cull)
                    return node[count];
            return -1;
        }
        // Opens an inner node, the nearer child last.
        CUDA_CALLABLE inline void open(const wp::BVH& tree, int left, int right, const Lane& ray, float pad,
            float t_cull)
        {
            float a = enter(tree, left, ray, pad, t_cull), b = enter(tree, right, ray, pad, t_cull);
            bool left_first = a <= b;
            int n[2] = { left_first ? right : left, left_first ? left : right };
            float t[2] = { left_first ? b : a, left_first ? a : b };
            for (int k = 0; k < 2; ++k)
                if (t[k] >= 0.0f)
                    push(n[k], t[k]);
        }
    };

    WR_FN bool leaf(const wp::Mesh& mesh, int begin, int end, int instance, const Lane& ray, Answer& best)
    {
        bool hit = false;
        for (int i = begin; i < end; ++i) {
            int face = mesh.bvh.primitive_indices[i];
            float p[3][3];
            for (int k = 0; k < 3; ++k)
                for (int a = 0; a < 3; ++a)
                    p[k][a] = mesh.points.data[mesh.indices.data[3 * face + k]][a];
            hit |= Triangle::offer(ray, p, instance, face, best);
        }
        return hit;
    }

    // any: stop at the first hit that counts.
    WR_FN void trace(const wp::Mesh& mesh, int instance, const Lane& ray, bool any, Answer& best)
    {
        const wp::BVH& tree = mesh.bvh;
        Walk walk;
        walk.count = 0;
        walk.push(*tree.root, 0.0f);
        for (int n = walk.pop(best.t_cull); n >= 0; n = walk.pop(best.t_cull)) {
            wp::BVHPackedNodeHalf lower = wp::bvh_load_node(tree.node_lowers, n);
            wp::BVHPackedNodeHalf upper = wp::bvh_load_node(tree.node_uppers, n);
            if (!lower.b)
                walk.open(tree, (int)(lower.i), (int)(upper.i), ray, 0.0f, best.t_cull);
            else if (leaf(mesh, (int)(lower.i), (int)(upper.i), instance, ray, best) && any)
                return;
        }
    }
};

// ---------------------------------------------------------------- eight boxes, four triangles at once

#ifndef WR_SCALAR
// Triangle::offer for all triangles of a block, as many as the vector type V has lanes; true if one was taken. Lambdas,
// for classes inside a function have no templates.
//
//   o                        the ray's origin in the block's space, in the order of kx, ky, kz
//   bits                     the lanes of a comparison as an unsigned
//   instance_of              the instance of a lane
static constexpr auto larger_of = [](auto a, auto b) { return a > b ? a : b; };
static constexpr auto smaller_of = [](auto a, auto b) { return a < b ? a : b; };
static constexpr auto extreme_of = [](const auto* a) {
    return larger_of(larger_of(__builtin_elementwise_abs(a[0]), __builtin_elementwise_abs(a[1])),
        __builtin_elementwise_abs(a[2]));
};
// Triangle::error.
static constexpr auto errors_of = [](const Lane& ray, const auto* x, const auto* y, const auto* z, auto inverse) {
    auto mx = extreme_of(x), my = extreme_of(y), mz = extreme_of(z), one = inverse;
    one = 1.0f;
    auto depth = mz * Bound::magnitude(ray.d[ray.kz]);
    auto dx = Bound::gamma(5) * (mx + depth), dy = Bound::gamma(5) * (my + depth);
    auto edge = Bound::gamma(2) * mx * my + dy * mx + dx * my + dx * dy;
    auto weight = smaller_of(16.0f * edge * __builtin_elementwise_abs(inverse), one);
    auto spread = larger_of(larger_of(z[0], z[1]), z[2]) - smaller_of(smaller_of(z[0], z[1]), z[2]);
    return mz * Bound::gamma(8) + weight * spread;
};
static constexpr auto corners_of = [](const auto& block, int k, float p[3][3]) {
    for (int i = 0; i < 3; ++i)
        for (int a = 0; a < 3; ++a)
            p[i][a] = block.corner[i][a][k];
};
static constexpr auto offer_block = [](const auto* o, auto bits, const auto& block, auto instance_of, const Lane& ray,
                                        Answer& best) {
    WR_NO_FUSION
    typedef decltype(o[0] + o[0]) V;
    V x[3], y[3], z[3];
    for (int k = 0; k < 3; ++k) {
        V c = *(const V*)block.corner[k][ray.kz] - o[2];
        x[k] = (*(const V*)block.corner[k][ray.kx] - o[0]) - c * ray.sx;
        y[k] = (*(const V*)block.corner[k][ray.ky] - o[1]) - c * ray.sy;
        z[k] = c * ray.sz;
    }
    V e0 = x[2] * y[1] - y[2] * x[1], e1 = x[0] * y[2] - y[0] * x[2], e2 = x[1] * y[0] - y[1] * x[0];
    V zero = 0.0f;
    unsigned unsure = bits((e0 == zero) | (e1 == zero) | (e2 == zero));
    unsigned inside = ~unsure
        & bits(((e0 > zero) & (e1 > zero) & (e2 > zero)) | ((e0 < zero) & (e1 < zero) & (e2 < zero)));
    bool hit = false;
    float p[3][3];
    if (inside) {
        V inverse = 1.0f / (e0 + e1 + e2);
        V w1 = e1 * inverse, w2 = e2 * inverse;
        V t = z[0] + w1 * (z[1] - z[0]) + w2 * (z[2] - z[0]);
        V err = errors_of(ray, x, y, z, inverse);
        for (inside &= bits((t >= -err) & (t <= best.t + err)); inside; inside &= inside - 1) {
            int k = __builtin_ctz(inside);
            corners_of(block, k, p);
            hit |= Triangle::settle(ray, p, t[k], err[k], w1[k], w2[k], instance_of(k),
                block.face[k] & 0x7fffffff, best);
        }
    }
    for (; unsure; unsure &= unsure - 1) {
        int k = __builtin_ctz(unsure);
        corners_of(block, k, p);
        hit |= Triangle::offer(ray, p, instance_of(k), block.face[k] & 0x7fffffff, best);
    }
    return hit;
};

struct Wide {
    enum { slots = 8, lanes = 4, depth = 36, stack = depth * 7 + 8, no_face = 0x7fffffff };
    typedef float Eight __attribute__((ext_vector_type(8), aligned(4)));
    typedef float Four __attribute__((ext_vector_type(4), aligned(4)));
    typedef int FourInt __attribute__((ext_vector_type(4), aligned(4)));
    typedef bool EightBits __attribute__((ext_vector_type(8)));
    typedef bool FourBits __attribute__((ext_vector_type(4)));

    struct Node {
        float plane[6][slots];  // lower x, y, z, upper x, y, z; the box of an empty slot is inverted
        int child[slots];       // a node, or ~ the leaf's first block; children come after their parents
    };
    struct Block {
        float corner[3][3][lanes];  // vertex, axis, lane; NaN, which no comparison accepts, where there is no face
        int face[lanes];            // the sign bit of lane 0 marks the leaf's last block
    };
    struct Entry {
        float near;
        int ref;
    };
    // Which plane a ray meets first, by its direction's signs, and the ray's constants for the slab test.
    struct Slabs {
        int near[3], far[3];
        float o_near[3], o_far[3], r[3];
    };
    // The origin may be off by pad in either direction.
    WR_FN Slabs slabs(const Lane& ray, float pad)
    {
        Slabs s;
        for (int k = 0; k < 3; ++k) {
            bool down = ray.r[k] < 0.0f;
            s.near[k] = down ? k + 3 : k;
            s.far[k] = down ? k : k + 3;
            s.o_near[k] = down ? ray.o[k] - pad : ray.o[k] + pad;
            s.o_far[k] = down ? ray.o[k] + pad : ray.o[k] - pad;
            s.r[k] = ray.r[k];
        }
        return s;
    }
    WR_FN Eight eight(const float* p) { return *(const Eight*)p; }
    WR_FN Four four(const float* p) { return *(const Four*)p; }
    WR_FN unsigned bits(FourInt m)
    {
        return __builtin_bit_cast(unsigned char, __builtin_convertvector(m, FourBits)) & 15u;
    }
    WR_FN unsigned meets(Eight near, Eight far)
    {
        return __builtin_bit_cast(unsigned char, __builtin_convertvector(near <= far * Bound::slab(), EightBits));
    }

    // Bit k: the ray meets box k. NaN as in Binary::enter.
    WR_FN unsigned enter(const Node& n, const Slabs& s, float t_cull, Eight& near)
    {
        Eight far = t_cull;
        near = 0.0f;
        for (int k = 0; k < 3; ++k) {
            Eight a = (eight(n.plane[s.near[k]]) - s.o_near[k]) * s.r[k];
            Eight b = (eight(n.plane[s.far[k]]) - s.o_far[k]) * s.r[k];
            near = a > near ? a : near;
            far = b < far ? b : far;
        }
        return meets(near, far);
    }

    // Pushes all boxes of the mask but the nearest, farthest first; returns the nearest.
    WR_FN int nearest(const int* ref, const Eight& near, unsigned mask, Entry*& top)
    {
        int a = __builtin_ctz(mask);
        mask &= mask - 1;
        if (!mask)
            return ref[a];
        float t[slots];
        *(Eight*)t = near;
        int b = __builtin_ctz(mask);
        mask &= mask - 1;
        if (!mask) {
            bool swap = t[b] < t[a];
            *top++ = { swap ? t[a] : t[b], swap ? ref[a] : ref[b] };
            return swap ? ref[b] : ref[a];
        }
        Entry* first = top;
        *top++ = { t[a], ref[a] };
        insert({ t[b], ref[b] }, first, top);
        for (; mask; mask &= mask - 1) {
            int c = __builtin_ctz(mask);
            insert({ t[c], ref[c] }, first, top);
        }
        return (--top)->ref;
    }
    WR_FN void insert(Entry e, Entry* first, Entry*& top)
    {
        Entry* p = top++;
        for (; p > first && p[-1].near < e.near; --p)
            *p = p[-1];
        *p = e;
    }
    // The next entry that may matter; false: none.
    WR_FN bool pop(const Entry* stack, Entry*& top, float t_cull, int& ref)
    {
        while (top != stack)
            if ((--top)->near <= t_cull) {
                ref = top->ref;
                return true;
            }
        return false;
    }
    // A random node is a cache miss or four: ask for all children that will be visited before choosing among them.
    WR_FN void prefetch(const Node* nodes, const Block* blocks, const Node& n, unsigned mask)
    {
        for (; mask; mask &= mask - 1) {
            int ref = n.child[__builtin_ctz(mask)];
            const char* p = ref >= 0 ? (const char*)(nodes + ref) : (const char*)(blocks + ~ref);
            for (int line = 0; line < 4; ++line)
                __builtin_prefetch(p + 64 * line);
        }
    }

    WR_FN bool leaf(const Block* block, int instance, const Lane& ray, Answer& best)
    {
        bool hit = false;
        for (;; ++block) {
            hit |= test(*block, instance, ray, best);
            if (block->face[0] < 0)
                return hit;
        }
    }
    // Triangle::offer for the four of one block.
    WR_FN bool test(const Block& block, int instance, const Lane& ray, Answer& best)
    {
        Four o[3] = { ray.o[ray.kx], ray.o[ray.ky], ray.o[ray.kz] };
        return offer_block(o, bits, block, [&](int) { return instance; }, ray, best);
    }

    // Whether a tree's root holds one leaf and no more; empty slots refer to the root.
    WR_FN bool is_leaf(const Node& root) { return root.child[0] < 0 && root.child[1] == 0; }

    // any: stop at the first hit that counts.
    static __attribute__((noinline)) void trace(const Node* nodes, const Block* blocks, int instance, const Lane& ray,
        bool any, Answer& best)
    {
        Slabs s = slabs(ray, 0.0f);
        Entry entries[stack];
        Entry* top = entries;
        int ref = 0;
        for (;;) {
            while (ref >= 0) {
                Eight near;
                const Node& n = nodes[ref];
                unsigned mask = enter(n, s, best.t_cull, near);
                if (!mask)
                    break;
                prefetch(nodes, blocks, n, mask);
                ref = nearest(n.child, near, mask, top);
            }
            if (ref < 0 && leaf(blocks + ~ref, instance, ray, best) && any)
                return;
            if (!pop(entries, top, best.t_cull, ref))
                return;
        }
    }
};

// ---------------------------------------------------------------- many rays

// The rays of one call, and where their answers go.
struct Batch {
    const Wide::Node* nodes;
    const Wide::Block* blocks;
    bool cached;  // the tree stays in a core's own cache
    float scale;  // of the tree against the caller's coordinates, a power of two
    const wp::vec3 *origin, *direction;
    wp::array_t<float> t_max, t_after;  // one for all rays, or one a ray
    wp::array_t<int> face_after;
    float *t, *u, *v;  // closest
    int* face;
    bool* occluded;  // any

    CUDA_CALLABLE inline bool any() const { return occluded != nullptr; }
    CUDA_CALLABLE inline bool open(int i, Lane& ray, Answer& best) const
    {
        float o[3], d[3];
        for (int k = 0; k < 3; ++k) {
            o[k] = origin[i][k] * scale;
            d[k] = direction[i][k] * scale;
        }
        int end = t_max.shape[0] == 1 ? 0 : i, after = t_after.shape[0] == 1 ? 0 : i;
        bool good = Lane::make(ray, o, d);
        best = Answer::open(ray, t_max.data[end], t_after.data[after], 0, face_after.data[after]);
        return good;
    }
    CUDA_CALLABLE inline void close(int i, const Lane& ray, const Answer& best) const
    {
        if (any()) {
            occluded[i] = best.found();
            return;
        }
        t[i] = best.distance(ray);
        face[i] = best.face;
        u[i] = best.u;
        v[i] = best.v;
    }
};

// Incoherent rays: several walks take turns, so that one computes while the others' nodes come from memory. Where
// nothing has to come from far, one after the other is faster.
struct Stream {
    enum { width = 8 };
    struct Walk {
        Lane ray;
        Answer best;
        Wide::Slabs slabs;
        int ref, index;
        Wide::Entry* top;
        Wide::Entry entries[Wide::stack];
    };
    // One node or one leaf; false: the ray is done.
    WR_FN bool step(const Batch& batch, Walk& w)
    {
        if (w.ref >= 0) {
            Wide::Eight near;
            const Wide::Node& n = batch.nodes[w.ref];
            unsigned mask = Wide::enter(n, w.slabs, w.best.t_cull, near);
            if (mask) {
                Wide::prefetch(batch.nodes, batch.blocks, n, mask);
                w.ref = Wide::nearest(n.child, near, mask, w.top);
                return true;
            }
        } else if (Wide::leaf(batch.blocks + ~w.ref, 0, w.ray, w.best) && batch.any())
            return false;
        return Wide::pop(w.entries, w.top, w.best.t_cull, w.ref);
    }
    // Starts the next ray that can hit anything; false: none is left.
    WR_FN bool start(const Batch& batch, Walk& w, int& next, int end)
    {
        while (next < end) {
            w.index = next++;
            if (batch.open(w.index, w.ray, w.best)) {
                w.slabs = Wide::slabs(w.ray, 0.0f);
                w.ref = 0;
                w.top = w.entries;
                return true;
            }
            batch.close(w.index, w.ray, w.best);
        }
        return false;
    }
    WR_FN void run(const Batch& batch, int first, int end)
    {
        if (batch.cached)
            in_order(batch, first, end);
        else
            in_turns(batch, first, end);
    }
    WR_FN void in_order(const Batch& batch, int first, int end)
    {
        for (; first < end; ++first) {
            Lane ray;
            Answer best;
            if (batch.open(first, ray, best))
                Wide::trace(batch.nodes, batch.blocks, 0, ray, batch.any(), best);
            batch.close(first, ray, best);
        }
    }
    static __attribute__((noinline)) void in_turns(const Batch& batch, int first, int end)
    {
        Walk walks[width];
        Walk* live[width];
        int count = 0;
        while (count < width && start(batch, walks[count], first, end)) {
            live[count] = &walks[count];
            ++count;
        }
        while (count)
            for (int i = 0; i < count; ++i) {
                Walk& w = *live[i];
                if (step(batch, w))
                    continue;
                batch.close(w.index, w.ray, w.best);
                if (!start(batch, w, first, end))
                    live[i--] = live[--count];
            }
    }
};

// Coherent rays: one walk for sixteen. Nodes are tested against the interval of all origins and reciprocals, which
// float32's monotone rounding keeps conservative; at a leaf each ray tests its box, then its triangles as if alone.
struct Group {
    enum { size = 16 };
    Lane ray[size];
    Answer best[size];
    float o[3][size], r[3][size], t_cull[size];
    float o_near[3], o_far[3], r_min[3], r_max[3], t_cull_max;
    int near[3], far[3];

    // False where the rays are too different to share a walk.
    CUDA_CALLABLE inline bool gather(const Batch& batch, int first)
    {
        for (int i = 0; i < size; ++i) {
            if (!batch.open(first + i, ray[i], best[i]) || ray[i].unit != 1.0f)
                return false;
            t_cull[i] = best[i].t_cull;
            for (int k = 0; k < 3; ++k) {
                o[k][i] = ray[i].o[k];
                r[k][i] = ray[i].r[k];
            }
        }
        cull();
        float spread = 0.0f, longest = 0.0f;
        for (int k = 0; k < 3; ++k) {
            if (!interval(k))
                return false;
            float a = 1.0f / r_min[k], b = 1.0f / r_max[k];
            spread = Bound::larger(spread, a - b);
            longest = Bound::larger(longest, Bound::larger(a, -b));
        }
        // a bundle wider than an eighth visits more boxes together than apart
        return 8.0f * spread < longest;
    }
    // One axis: all rays must go the same way.
    CUDA_CALLABLE inline bool interval(int k)
    {
        float o_min = o[k][0], o_max = o[k][0];
        r_min[k] = r_max[k] = r[k][0];
        for (int i = 1; i < size; ++i) {
            o_min = Bound::smaller(o[k][i], o_min);
            o_max = Bound::larger(o[k][i], o_max);
            r_min[k] = Bound::smaller(r[k][i], r_min[k]);
            r_max[k] = Bound::larger(r[k][i], r_max[k]);
        }
        bool down = r_max[k] < 0.0f;
        near[k] = down ? k + 3 : k;
        far[k] = down ? k : k + 3;
        o_near[k] = down ? o_min : o_max;
        o_far[k] = down ? o_max : o_min;
        return (down || r_min[k] > 0.0f) && r_max[k] - r_min[k] < Bound::infinity();
    }
    CUDA_CALLABLE inline void cull()
    {
        t_cull_max = t_cull[0];
        for (int i = 1; i < size; ++i)
            t_cull_max = Bound::larger(t_cull[i], t_cull_max);
    }
    // Boxes that any ray of the group may meet.
    CUDA_CALLABLE inline unsigned enter(const Wide::Node& n, Wide::Eight& first) const
    {
        Wide::Eight last = t_cull_max;
        first = 0.0f;
        for (int k = 0; k < 3; ++k) {
            Wide::Eight a = Wide::eight(n.plane[near[k]]) - o_near[k], b = Wide::eight(n.plane[far[k]]) - o_far[k];
            Wide::Eight a0 = a * r_min[k], a1 = a * r_max[k], b0 = b * r_min[k], b1 = b * r_max[k];
            a0 = a0 < a1 ? a0 : a1;
            b0 = b0 > b1 ? b0 : b1;
            first = a0 > first ? a0 : first;
            last = b0 < last ? b0 : last;
        }
        return Wide::meets(first, last);
    }
    // Rays that meet one box.
    CUDA_CALLABLE inline unsigned members(const Wide::Node& n, int slot) const
    {
        unsigned bits = 0;
        for (int i = 0; i < size; i += 8) {
            Wide::Eight first = 0.0f, last = Wide::eight(t_cull + i);
            for (int k = 0; k < 3; ++k) {
                Wide::Eight a = (n.plane[near[k]][slot] - Wide::eight(o[k] + i)) * Wide::eight(r[k] + i);
                Wide::Eight b = (n.plane[far[k]][slot] - Wide::eight(o[k] + i)) * Wide::eight(r[k] + i);
                first = a > first ? a : first;
                last = b < last ? b : last;
            }
            bits |= Wide::meets(first, last) << i;
        }
        return bits;
    }
    // A ray that needs no more gets a negative t_cull, which no box passes.
    CUDA_CALLABLE inline void leaf(const Wide::Block* block, unsigned mask, bool any)
    {
        bool hit = false;
        for (; mask; mask &= mask - 1) {
            int i = __builtin_ctz(mask);
            if (Wide::leaf(block, 0, ray[i], best[i])) {
                t_cull[i] = any ? -1.0f : best[i].t_cull;
                hit = true;
            }
        }
        if (hit)
            cull();
    }
    // Stack entries name a slot, node * 8 + slot, since the leaf needs its box.
    CUDA_CALLABLE inline void trace(const Batch& batch)
    {
        Wide::Entry entries[Wide::stack];
        Wide::Entry* top = entries;
        int where = 0, ref = 0;
        for (;;) {
            while (ref >= 0) {
                Wide::Eight first;
                const Wide::Node& n = batch.nodes[ref];
                unsigned mask = enter(n, first);
                if (!mask)
                    break;
                Wide::prefetch(batch.nodes, batch.blocks, n, mask);
                int names[Wide::slots];
                for (int k = 0; k < Wide::slots; ++k)
                    names[k] = ref * Wide::slots + k;
                where = Wide::nearest(names, first, mask, top);
                ref = child(batch, where);
            }
            if (ref < 0)
                leaf(batch.blocks + ~ref, members(batch.nodes[where / Wide::slots], where % Wide::slots), batch.any());
            if (!Wide::pop(entries, top, t_cull_max, where))
                return;
            ref = child(batch, where);
        }
    }
    WR_FN int child(const Batch& batch, int where)
    {
        return batch.nodes[where / Wide::slots].child[where % Wide::slots];
    }
    static __attribute__((noinline)) void run(const Batch& batch, int first, int end)
    {
        Group g;
        for (; first + size <= end && g.gather(batch, first); first += size) {
            g.trace(batch);
            for (int i = 0; i < size; ++i)
                batch.close(first + i, g.ray[i], g.best[i]);
        }
        Stream::run(batch, first, end);
    }
};
#endif
