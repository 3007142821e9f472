// Warp's binary trees made into the wide nodes of traversal.h, and new boxes for what has moved. CPU only.
//
// Pasted after traversal.h, under the same rules.
//
//   Collapse    which binary nodes share a wide one, and which faces share a block
//   Refit       triangles and boxes, from the leaves up: at the build and whenever points have moved
//
// Source: Ylitie, Karras, Laine, "Efficient Incoherent Ray Traversal on GPUs Through Compressed Wide BVHs", HPG 2017.

struct Collapse {
    // How best to hold a subtree in at most k + 1 slots of a wide node: what the wide nodes below it cost, and how
    // many of the slots its left child gets; 0: fewer slots do as well, and one slot means a wide node of its own.
    struct Plan {
        float cost[Wide::slots];
        unsigned char left[Wide::slots];
    };
    WR_FN int left_of(const wp::BVH& tree, int node) { return (int)(tree.node_lowers[node].i); }
    WR_FN int right_of(const wp::BVH& tree, int node) { return (int)(tree.node_uppers[node].i); }
    WR_FN bool is_leaf(const wp::BVH& tree, int node) { return tree.node_lowers[node].b; }
    WR_FN float area(const wp::BVH& tree, int node)
    {
        const wp::BVHPackedNodeHalf &a = tree.node_lowers[node], &b = tree.node_uppers[node];
        float x = b.x - a.x, y = b.y - a.y, z = b.z - a.z;
        return x * y + y * z + z * x;
    }
    // Fewest expected node visits by the surface area heuristic (Ylitie, Karras, Laine 2017, section 3).
    WR_FN void plan(const wp::BVH& tree, int node, Plan* plans)
    {
        typedef int Eight __attribute__((ext_vector_type(8)));
        typedef unsigned char Bytes __attribute__((ext_vector_type(8), aligned(1)));
        Plan& p = plans[node];
        p = {};
        if (is_leaf(tree, node))
            return;
        const Plan &l = plans[left_of(tree, node)], &r = plans[right_of(tree, node)];
        float right[2 * Wide::slots];  // costs of the right child after as many impossible ones
        for (int k = 0; k < Wide::slots; ++k) {
            right[k] = Bound::infinity();
            right[k + Wide::slots] = r.cost[k];
        }
        Wide::Eight cost = Bound::infinity();
        Eight left = 0;
        for (int i = 1; i < Wide::slots; ++i) {
            Wide::Eight c = Wide::eight(right + Wide::slots - i) + l.cost[i - 1];
            left = c < cost ? i : left;
            cost = c < cost ? c : cost;
        }
        // more slots never cost more: the running minimum, by doubling
        cost[0] = cost[Wide::slots - 1] + area(tree, node);
        Wide::Eight none = Bound::infinity(), least = cost;
        least = smaller_of(least, __builtin_shufflevector(least, none, 8, 0, 1, 2, 3, 4, 5, 6));
        least = smaller_of(least, __builtin_shufflevector(least, none, 8, 8, 0, 1, 2, 3, 4, 5));
        least = smaller_of(least, __builtin_shufflevector(least, none, 8, 8, 8, 8, 0, 1, 2, 3));
        left = cost < __builtin_shufflevector(least, none, 8, 0, 1, 2, 3, 4, 5, 6) ? left : 0;
        *(Wide::Eight*)p.cost = least;
        *(Bytes*)p.left = __builtin_convertvector(left, Bytes);
    }
    // All plans, children first: Warp numbers parents before their children. False if this tree does not.
    WR_FN bool plan_all(const wp::BVH& tree, Plan* plans)
    {
        for (int node = tree.num_nodes - 1; node >= 0; --node) {
            if (!is_leaf(tree, node) && (left_of(tree, node) <= node || right_of(tree, node) <= node))
                return false;
            plan(tree, node, plans);
        }
        return true;
    }
    // The binary nodes whose boxes one wide node holds.
    WR_FN int members(const wp::BVH& tree, const Plan* plans, int node, int* slot)
    {
        struct Part {
            int node, slots;
        };
        Part todo[Wide::slots + 1];
        int waiting = 0, count = 0;
        bool whole = true;  // the node itself is opened whatever its plan
        todo[waiting++] = { node, Wide::slots };
        while (waiting) {
            Part part = todo[--waiting];
            int k = part.slots - 1;
            while (k > 0 && plans[part.node].left[k] == 0)
                --k;
            int left = plans[part.node].left[k];
            if (whole && k == 0 && !is_leaf(tree, node))
                k = left = 1;
            whole = false;
            if (k == 0) {
                slot[count++] = part.node;
                continue;
            }
            todo[waiting++] = { right_of(tree, part.node), k + 1 - left };
            todo[waiting++] = { left_of(tree, part.node), left };
        }
        return count;
    }
    // The faces of one leaf, in blocks that follow each other; the number of blocks.
    WR_FN int faces(const wp::BVH& tree, int begin, int end, Wide::Block* block)
    {
        int count = (end - begin + Wide::lanes - 1) / Wide::lanes;
        for (int i = 0; i < count * Wide::lanes; ++i)
            block[i / Wide::lanes].face[i % Wide::lanes]
                = begin + i < end ? tree.primitive_indices[begin + i] : Wide::no_face;
        block[count - 1].face[0] |= 0x80000000;
        return count;
    }
    // The instances of one leaf; the sign bit marks the last.
    WR_FN int instances(const wp::BVH& tree, int begin, int end, int* item)
    {
        for (int i = begin; i < end; ++i)
            item[i - begin] = tree.primitive_indices[i];
        item[end - begin - 1] |= 0x80000000;
        return end - begin;
    }
    // Writes which node holds what, parents first, but no boxes (see Refit). Leaves are blocks of faces, each
    // leaf's last one with its node and slot in slots, or, where blocks is null, items. counts: nodes, blocks or
    // items, depth; depth 0: the tree is not as expected.
    WR_FN void layout(const wp::BVH& tree, Plan* plans, Wide::Node* nodes, Wide::Block* blocks, int* items, int* slots,
        int* counts)
    {
        struct Task {
            int binary, wide, depth;
        };
        Task todo[Wide::stack];
        int waiting = 0, n_nodes = 1, n_leaves = 0, depth = 0;
        if (!plan_all(tree, plans))
            return;
        todo[waiting++] = { *tree.root, 0, 1 };
        while (waiting) {
            Task task = todo[--waiting];
            int slot[Wide::slots];
            int count = members(tree, plans, task.binary, slot);
            Wide::Node& n = nodes[task.wide];
            depth = task.depth > depth ? task.depth : depth;
            for (int k = 0; k < Wide::slots; ++k) {
                empty(n, k);
                if (k < count && is_leaf(tree, slot[k])) {
                    int begin = left_of(tree, slot[k]), end = right_of(tree, slot[k]);
                    n.child[k] = ~n_leaves;
                    n_leaves += blocks ? faces(tree, begin, end, blocks + n_leaves)
                                       : instances(tree, begin, end, items + n_leaves);
                    if (blocks)
                        slots[n_leaves - 1] = task.wide * Wide::slots + k;
                } else if (k < count) {
                    n.child[k] = n_nodes;
                    todo[waiting++] = { slot[k], n_nodes++, task.depth + 1 };
                }
            }
        }
        counts[0] = n_nodes;
        counts[1] = n_leaves;
        counts[2] = depth;
    }
    // An empty slot refers to the root, which no node has as its child.
    WR_FN void empty(Wide::Node& n, int k)
    {
        for (int i = 0; i < 6; ++i)
            n.plane[i][k] = i < 3 ? Bound::infinity() : -Bound::infinity();
        n.child[k] = 0;
    }
};

// Boxes of wide nodes, from the leaves up.
struct Refit {
    struct Box {
        float plane[6];
    };
    WR_FN Box nothing()
    {
        float f = Bound::infinity();
        return { { f, f, f, -f, -f, -f } };
    }
    WR_FN void grow(Box& box, const float* lower, const float* upper)
    {
        for (int k = 0; k < 3; ++k) {
            box.plane[k] = Bound::smaller(lower[k], box.plane[k]);
            box.plane[k + 3] = Bound::larger(upper[k], box.plane[k + 3]);
        }
    }
    WR_FN void store(Wide::Node& n, int k, const Box& box)
    {
        for (int i = 0; i < 6; ++i)
            n.plane[i][k] = box.plane[i];
    }
    // The points of one lane's face; false: one is repeated or not finite, and the face is left out.
    WR_FN bool gather(const int* index, const wp::vec3* points, float scale, float p[3][3])
    {
        float check = 0.0f;
        for (int i = 0; i < 3; ++i)
            for (int a = 0; a < 3; ++a) {
                p[i][a] = points[index[i]][a] * scale;
                check += p[i][a] * 0.0f;
            }
        return check == 0.0f && index[0] != index[1] && index[1] != index[2] && index[2] != index[0];
    }
    // Fills a block and its box; the number of faces left out.
    WR_FN int fill(Wide::Block& block, const wp::vec3* points, const int* indices, float scale, Box& box)
    {
        int dropped = 0;
        for (int i = 0; i < Wide::lanes; ++i) {
            int face = block.face[i] & Wide::no_face;
            float p[3][3];
            bool present = face != Wide::no_face, good = present && gather(indices + 3 * face, points, scale, p);
            dropped += present && !good;
            for (int j = 0; j < 9; ++j)
                block.corner[j / 3][j % 3][i] = good ? p[j / 3][j % 3] : __builtin_nanf("");
        }
        for (int a = 0; a < 3; ++a) {
            Wide::Four lower = Bound::infinity(), upper = -Bound::infinity();
            for (int i = 0; i < 3; ++i) {
                Wide::Four c = Wide::four(block.corner[i][a]);
                lower = smaller_of(c, lower);
                upper = larger_of(c, upper);
            }
            box.plane[a] = Bound::smaller(__builtin_reduce_min(lower), box.plane[a]);
            box.plane[a + 3] = Bound::larger(__builtin_reduce_max(upper), box.plane[a + 3]);
        }
        return dropped;
    }
    // The triangles and the boxes of all leaves that begin in blocks [first, end) of count; the number of faces left
    // out. Faces come in no order of memory, so their indices and points are asked for some blocks ahead.
    WR_FN int leaves(Wide::Node* nodes, Wide::Block* blocks, const int* slots, const wp::vec3* points,
        const int* indices, float scale, int first, int end, int count)
    {
        int dropped = 0;
        Box box = nothing();
        while (first < end && first > 0 && blocks[first - 1].face[0] >= 0)
            ++first;
        for (int b = first; b < end || (b < count && b > first && blocks[b - 1].face[0] >= 0); ++b) {
            ask(blocks, indices, points, b, count);
            dropped += fill(blocks[b], points, indices, scale, box);
            if (blocks[b].face[0] < 0) {
                store(nodes[slots[b] / Wide::slots], slots[b] % Wide::slots, box);
                box = nothing();
            }
        }
        return dropped;
    }
    WR_FN void ask(const Wide::Block* blocks, const int* indices, const wp::vec3* points, int b, int count)
    {
        for (int i = 0; i < Wide::lanes && b + 8 < count; ++i) {
            int later = blocks[b + 8].face[i] & Wide::no_face, soon = blocks[b + 4].face[i] & Wide::no_face;
            if (later != Wide::no_face)
                __builtin_prefetch(indices + 3 * later);
            for (int k = 0; k < 3 && soon != Wide::no_face; ++k)
                __builtin_prefetch(points + indices[3 * soon + k]);
        }
    }
    // The boxes of all leaves of instances.
    WR_FN void items(Wide::Node* nodes, const int* item, const wp::vec3* lowers, const wp::vec3* uppers, int count)
    {
        for (int n = 0; n < count; ++n)
            for (int k = 0; k < Wide::slots; ++k) {
                if (nodes[n].child[k] >= 0)
                    continue;
                Box box = nothing();
                const int* p = item + ~nodes[n].child[k];
                for (bool last = false; !last; ++p) {
                    last = *p < 0;
                    wp::vec3 l = lowers[*p & Wide::no_face], u = uppers[*p & Wide::no_face];
                    float lower[3] = { l[0], l[1], l[2] }, upper[3] = { u[0], u[1], u[2] };
                    grow(box, lower, upper);
                }
                store(nodes[n], k, box);
            }
    }
    WR_FN Box whole(const Wide::Node& n)
    {
        Box box = nothing();
        for (int k = 0; k < Wide::slots; ++k) {
            float lower[3] = { n.plane[0][k], n.plane[1][k], n.plane[2][k] };
            float upper[3] = { n.plane[3][k], n.plane[4][k], n.plane[5][k] };
            grow(box, lower, upper);
        }
        return box;
    }
    WR_FN float area(const Box& b)
    {
        float x = b.plane[3] - b.plane[0], y = b.plane[4] - b.plane[1], z = b.plane[5] - b.plane[2];
        return x >= 0.0f ? x * y + y * z + z * x : 0.0f;
    }
    WR_FN Box common(const Box& a, const Box& b)
    {
        Box box;
        for (int k = 0; k < 3; ++k) {
            box.plane[k] = Bound::larger(a.plane[k], b.plane[k]);
            box.plane[k + 3] = Bound::smaller(a.plane[k + 3], b.plane[k + 3]);
            if (!(box.plane[k] <= box.plane[k + 3]))
                return nothing();
        }
        return box;
    }
    // The boxes of inner nodes: children have larger indices than their parents. summary: the whole box, the expected
    // number of nodes and leaves that a ray through it visits, and that a ray visits through the box that is given
    // behind it: the whole one as it was at the build, so that a body that flew off does not hide all others.
    WR_FN void inner(Wide::Node* nodes, int count, float* summary)
    {
        double visits = 0.0, within = 0.0;
        Box before;
        for (int i = 0; i < 6; ++i)
            before.plane[i] = summary[8 + i];
        for (int n = count - 1; n >= 0; --n)
            for (int k = 0; k < Wide::slots; ++k) {
                if (nodes[n].child[k] > 0)
                    store(nodes[n], k, whole(nodes[nodes[n].child[k]]));
                Box box = { { nodes[n].plane[0][k], nodes[n].plane[1][k], nodes[n].plane[2][k], nodes[n].plane[3][k],
                    nodes[n].plane[4][k], nodes[n].plane[5][k] } };
                visits += area(box);
                within += area(common(box, before));
            }
        Box box = whole(nodes[0]);
        for (int i = 0; i < 6; ++i)
            summary[i] = box.plane[i];
        summary[6] = area(box) > 0.0f ? (float)(visits / area(box)) : 0.0f;
        summary[7] = area(before) > 0.0f ? (float)(within / area(before)) : 0.0f;
    }
};
