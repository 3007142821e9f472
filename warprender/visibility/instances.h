// Rays through placed shapes: the walk over instances, and the sweep over all triangles where there are few.
//
// Pasted after traversal.h, under the same rules.
//
//   Few       all triangles of a small scene, eight at once
//   World     the walk over instances

struct Geometry {
    int kind;  // 0 triangles, 1 a sphere about the origin
    float radius;
    wp::uint64 mesh, nodes, blocks;
};
struct Instance {
    float to_object[3][4], to_world[3][4];
    int geometry;
    int placed;  // 0: to_object is the identity, 3: it only moves; records.MOVED
};

#ifndef WR_SCALAR
// The triangles of all instances, where they are few and only moved: no tree pays for as many as fit in here.
struct Few {
    enum { lanes = 8, most = 8 };
    typedef int EightInt __attribute__((ext_vector_type(8), aligned(4)));

    struct Block {
        float corner[3][3][lanes];  // vertex, axis, lane; NaN where there is no face
        int instance[lanes], face[lanes];
        float shift[3];  // from the world to the space of its instances
        int other;       // whether the block before has another shift
        int unused[12];
    };
    int count;  // of blocks; -1 where there are more triangles, other shapes, or instances that are more than moved
    int unused[15];
    Block blocks[most];

    WR_FN unsigned bits(EightInt m)
    {
        return __builtin_bit_cast(unsigned char, __builtin_convertvector(m, Wide::EightBits));
    }
    // The ray's origin is moved along: a copy of what was just stored field by field stalls.
    static __attribute__((noinline)) void trace(const Few& few, Lane& ray, bool any, Answer& best)
    {
        float start[3] = { ray.o[0], ray.o[1], ray.o[2] };
        Wide::Eight o[3];
        for (int b = 0; b < few.count; ++b) {
            const Block& block = few.blocks[b];
            if (block.other) {
                for (int k = 0; k < 3; ++k)
                    ray.o[k] = start[k] + block.shift[k];
                o[0] = ray.o[ray.kx];
                o[1] = ray.o[ray.ky];
                o[2] = ray.o[ray.kz];
            }
            auto instance_of = [&](int lane) { return block.instance[lane]; };
            if (offer_block(o, bits, block, instance_of, ray, best) && any)
                return;
        }
    }
    // Takes the triangles of one mesh in; false: there are too many.
    WR_FN bool add(Few& few, int& used, const Wide::Node* nodes, const Wide::Block* blocks, const Instance& place,
        int instance)
    {
        if (used && !alike(few.blocks[(used - 1) / lanes], place))
            used = (used + lanes - 1) / lanes * lanes;
        int todo[Wide::stack], waiting = 0;
        todo[waiting++] = 0;
        while (waiting) {
            int ref = todo[--waiting];
            for (int k = 0; ref >= 0 && k < Wide::slots; ++k)
                if (nodes[ref].child[k] != 0)
                    todo[waiting++] = nodes[ref].child[k];
            for (const Wide::Block* block = blocks + ~ref; ref < 0; ++block) {
                for (int k = 0; k < Wide::lanes; ++k) {
                    if (!(block->corner[0][0][k] == block->corner[0][0][k]))
                        continue;
                    if (used == lanes * most)
                        return false;
                    Block& to = few.blocks[used / lanes];
                    int lane = used % lanes;
                    if (lane == 0)
                        open(few, used / lanes, place);
                    for (int i = 0; i < 3; ++i)
                        for (int a = 0; a < 3; ++a)
                            to.corner[i][a][lane] = block->corner[i][a][k];
                    to.instance[lane] = instance;
                    to.face[lane] = block->face[k] & Wide::no_face;
                    ++used;
                }
                if (block->face[0] < 0)
                    break;
            }
        }
        return true;
    }
    WR_FN bool alike(const Block& block, const Instance& place)
    {
        bool same = true;
        for (int a = 0; a < 3; ++a)
            same &= block.shift[a] == place.to_object[a][3];
        return same;
    }
    // A block without faces yet.
    WR_FN void open(Few& few, int number, const Instance& place)
    {
        Block& block = few.blocks[number];
        for (int i = 0; i < 3; ++i)
            for (int a = 0; a < 3; ++a)
                for (int k = 0; k < lanes; ++k)
                    block.corner[i][a][k] = __builtin_nanf("");
        for (int a = 0; a < 3; ++a)
            block.shift[a] = place.to_object[a][3];
        block.other = number == 0 || !alike(few.blocks[number - 1], place);
    }
    WR_FN void gather(Few& few, const Geometry* geometries, const Instance* instances, int count)
    {
        few.count = -1;
        int used = 0;
        for (int i = 0; i < count; ++i) {
            const Instance& place = instances[i];
            const Geometry& g = geometries[place.geometry];
            if (place.placed == 2 || (g.kind == 0 && !g.nodes))
                continue;
            if (g.kind != 0 || place.placed == 1
                || !add(few, used, (const Wide::Node*)(g.nodes), (const Wide::Block*)(g.blocks), place, i))
                return;
        }
        few.count = (used + lanes - 1) / lanes;
    }
};
#endif

struct World {
    const Geometry* geometries;
    const Instance* instances;
    int count;
    wp::uint64 tree, nodes, items;  // wp.Bvh over the instances' boxes, collapsed
    wp::uint64 few;                 // Few, 0 without
    float pad;                      // what transforms may add to a box, in units of the ray origin's largest component
    int listed;                     // 1, 2: only the instances members[first_member] to members[last_member - 1] are
                                    // there; 2: nodes and items are a tree over them
    int first_member, last_member;
    const int* members;
    const wp::vec3 *lowers, *uppers;  // the instances' boxes

    // The ray in object space; the direction keeps its length, so that t is the same in both.
    WR_FN bool enter(const Lane& ray, const Instance& place, Lane& local)
    {
        float m = 0.0f, check = 0.0f;
        if (place.placed == 3) {
            local = ray;
            for (int k = 0; k < 3; ++k) {
                local.o[k] = ray.o[k] + place.to_object[k][3];
                check += local.o[k] - local.o[k];
            }
            return check == 0.0f;
        }
        for (int k = 0; k < 3; ++k) {
            const float* row = place.to_object[k];
            local.o[k] = row[0] * ray.o[0] + row[1] * ray.o[1] + row[2] * ray.o[2] + row[3];
            local.d[k] = row[0] * ray.d[0] + row[1] * ray.d[1] + row[2] * ray.d[2];
            check += (local.o[k] - local.o[k]) + (local.d[k] - local.d[k]);
        }
        m = Bound::extreme(local.d);
        local.unit = ray.unit;
        if (!(check == 0.0f && m > 0.0f))
            return false;
        Lane::finish(local, m);
        return true;
    }
    WR_FN void shape(const Geometry& g, int instance, const Lane& ray, bool any, Answer& best)
    {
        if (g.kind == 1)
            Sphere::offer(ray, g.radius, instance, best);
#ifdef WR_FAST
        else if (g.mesh)
            Plain::offer(g.mesh, instance, ray, best);
#elif defined(WR_SCALAR)
        else if (g.mesh)
            Binary::trace(wp::mesh_get(g.mesh), instance, ray, any, best);
#else
        else if (g.nodes) {
            const Wide::Node* root = (const Wide::Node*)(g.nodes);
            const Wide::Block* blocks = (const Wide::Block*)(g.blocks);
            // Where the instance's box is that of the only leaf, the leaf's own tells nothing new.
            if (Wide::is_leaf(*root))
                Wide::leaf(blocks + ~root->child[0], instance, ray, best);
            else
                Wide::trace(root, blocks, instance, ray, any, best);
        }
#endif
    }
    WR_FN void visit(const World& w, int i, const Lane& ray, bool any, Answer& best)
    {
        const Instance& place = w.instances[i];
        const Geometry& g = w.geometries[place.geometry];
        if (!place.placed) {
            shape(g, i, ray, any, best);
            return;
        }
        Lane local;
        if (enter(ray, place, local))
            shape(g, i, local, any, best);
    }
    // any: stop at the first hit that counts.
    WR_WALK void trace(const World& w, const Lane& ray, bool any, Answer& best)
    {
        float pad = w.pad * Bound::extreme(ray.o);
        if (w.listed == 1) {
            walk_members(w, ray, pad, any, best);
            return;
        }
        if (w.listed == 0 && w.count < 2) {
            if (w.count == 1)
                visit(w, 0, ray, any, best);
            return;
        }
#ifdef WR_SCALAR
        walk_binary(w, ray, pad, any, best);
#else
        walk_wide(w, ray, pad, any, best);
#endif
    }
    // One by one: a few instances need no tree.
    WR_FN void walk_members(const World& w, const Lane& ray, float pad, bool any, Answer& best)
    {
        for (int k = w.first_member; k < w.last_member; ++k) {
            int i = w.members[k];
            float lo[3] = { w.lowers[i][0], w.lowers[i][1], w.lowers[i][2] };
            float hi[3] = { w.uppers[i][0], w.uppers[i][1], w.uppers[i][2] };
            if (Binary::slab(lo, hi, ray, pad, best.t_cull) < 0.0f)
                continue;
            visit(w, i, ray, any, best);
            if (any && best.found())
                return;
        }
    }
    WR_FN void walk_binary(const World& w, const Lane& ray, float pad, bool any, Answer& best)
    {
        const wp::BVH tree = wp::bvh_get(w.tree);
        Binary::Walk walk;
        walk.count = 0;
        walk.push(*tree.root, 0.0f);
        for (int n = walk.pop(best.t_cull); n >= 0; n = walk.pop(best.t_cull)) {
            wp::BVHPackedNodeHalf lower = wp::bvh_load_node(tree.node_lowers, n);
            wp::BVHPackedNodeHalf upper = wp::bvh_load_node(tree.node_uppers, n);
            if (!lower.b) {
                walk.open(tree, (int)(lower.i), (int)(upper.i), ray, pad, best.t_cull);
                continue;
            }
            for (int i = (int)(lower.i); i < (int)(upper.i); ++i) {
                visit(w, tree.primitive_indices[i], ray, any, best);
                if (any && best.found())
                    return;
            }
        }
    }
#ifndef WR_SCALAR
    static __attribute__((noinline)) void walk_wide(const World& w, const Lane& ray, float pad, bool any, Answer& best)
    {
        const Wide::Node* nodes = (const Wide::Node*)(w.nodes);
        Wide::Slabs s = Wide::slabs(ray, pad);
        Wide::Entry entries[Wide::stack];
        Wide::Entry* top = entries;
        int ref = 0;
        for (;;) {
            while (ref >= 0) {
                Wide::Eight near;
                unsigned mask = Wide::enter(nodes[ref], s, best.t_cull, near);
                if (!mask)
                    break;
                ref = Wide::nearest(nodes[ref].child, near, mask, top);
            }
            for (const int* item = (const int*)(w.items) + ~ref; ref < 0; ++item) {
                visit(w, *item & Wide::no_face, ray, any, best);
                if (any && best.found())
                    return;
                if (*item < 0)
                    break;
            }
            if (!Wide::pop(entries, top, best.t_cull, ref))
                return;
        }
    }
#endif
    // t, instance, face, u, v in one vector: native functions return no structs. Floats travel as their bits.
    WR_FN wp::vec_t<5, wp::int32> result(const Lane& ray, const Answer& best)
    {
        wp::vec_t<5, wp::int32> out;
        union {
            float f[3];
            int i[3];
        } bits = { { best.distance(ray), best.u, best.v } };
        out[0] = bits.i[0];
        out[1] = best.instance;
        out[2] = best.face;
        out[3] = bits.i[1];
        out[4] = bits.i[2];
        return out;
    }
    WR_WALK bool solve(const World& w, wp::vec3 o, wp::vec3 d, float t_max, float t_after, int instance_after,
        int face_after, bool any, Lane& ray, Answer& best)
    {
        float origin[3] = { o[0], o[1], o[2] }, direction[3] = { d[0], d[1], d[2] };
        float m = Lane::set(ray, origin, direction);
        best = Answer::open(ray, t_max, t_after, instance_after, face_after);
        if (!(m > 0.0f))
            return false;
#if !defined(WR_SCALAR) && !defined(WR_FAST)
        const Few* few = (const Few*)(w.few);
        if (few && few->count >= 0 && !w.listed) {
            Lane::shear(ray, m);
            Few::trace(*few, ray, any, best);
            return best.found();
        }
#endif
        Lane::finish(ray, m);
        trace(w, ray, any, best);
        return best.found();
    }
};
