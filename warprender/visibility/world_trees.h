// Wide trees over lists of instances, made at once from their boxes. CPU only.
//
// Pasted after traversal.h and collapse.h, under the same rules. Lists are short and all move in each step of a
// simulation, so a tree is not refitted but made anew: halves by the middle of the boxes' centres, three times a node.

struct WorldTree {
    struct Range {
        int begin, end;
    };
    struct Task {
        Range range;
        int node;
    };
    const wp::vec3 *lowers, *uppers;
    int* items;

    // Twice the centre of a box along an axis.
    CUDA_CALLABLE inline float centre(int at, int axis) const
    {
        int i = items[at] & Wide::no_face;
        return lowers[i][axis] + uppers[i][axis];
    }
    CUDA_CALLABLE inline Refit::Box box_of(Range range) const
    {
        Refit::Box box = Refit::nothing();
        for (int at = range.begin; at < range.end; ++at) {
            int i = items[at] & Wide::no_face;
            float lower[3] = { lowers[i][0], lowers[i][1], lowers[i][2] };
            float upper[3] = { uppers[i][0], uppers[i][1], uppers[i][2] };
            Refit::grow(box, lower, upper);
        }
        return box;
    }
    // Where the second half begins. Each has a quarter at least, which bounds the depth: 20 nodes for a million.
    CUDA_CALLABLE inline int split(Range range) const
    {
        float low[3], high[3];
        for (int k = 0; k < 3; ++k) {
            low[k] = Bound::infinity();
            high[k] = -Bound::infinity();
            for (int at = range.begin; at < range.end; ++at) {
                low[k] = Bound::smaller(centre(at, k), low[k]);
                high[k] = Bound::larger(centre(at, k), high[k]);
            }
        }
        float width[3] = { high[0] - low[0], high[1] - low[1], high[2] - low[2] };
        int axis = width[0] >= width[1] && width[0] >= width[2] ? 0 : (width[1] >= width[2] ? 1 : 2);
        float middle = 0.5f * low[axis] + 0.5f * high[axis];
        int first = range.begin;
        for (int at = range.begin; at < range.end; ++at)
            if (centre(at, axis) < middle) {
                int item = items[at];
                items[at] = items[first];
                items[first++] = item;
            }
        int quarter = (range.end - range.begin) / 4;
        bool even = first - range.begin >= quarter && range.end - first >= quarter;
        even = even && first > range.begin && first < range.end;
        return even ? first : (range.begin + range.end) / 2;
    }
    // The parts that one node's slots hold.
    CUDA_CALLABLE inline int parts(Range range, Range* part) const
    {
        int count = 1;
        part[0] = range;
        if (range.end - range.begin <= Wide::slots) {
            for (count = 0; count < range.end - range.begin; ++count)
                part[count] = { range.begin + count, range.begin + count + 1 };
            return count;
        }
        for (int round = 0; round < 3; ++round)
            for (int k = count - 1; k >= 0; --k) {
                if (part[k].end - part[k].begin < 2)
                    continue;
                int middle = split(part[k]);
                part[count++] = { middle, part[k].end };
                part[k].end = middle;
            }
        return count;
    }
    // Over the instances items[0] to items[count - 1], which are put in order; there is room for `count` nodes, and one.
    WR_FN void build(const wp::vec3* lowers, const wp::vec3* uppers, int* items, int count, Wide::Node* nodes)
    {
        WorldTree t = { lowers, uppers, items };
        Task todo[Wide::stack];
        int waiting = 0, made = 1;
        todo[waiting++] = { { 0, count }, 0 };
        while (waiting) {
            Task task = todo[--waiting];
            Wide::Node& n = nodes[task.node];
            Range part[Wide::slots];
            int used = t.parts(task.range, part);
            for (int k = 0; k < Wide::slots; ++k) {
                Collapse::empty(n, k);
                if (k >= used)
                    continue;
                Refit::store(n, k, t.box_of(part[k]));
                if (part[k].end - part[k].begin == 1) {
                    n.child[k] = ~part[k].begin;
                    items[part[k].begin] |= 0x80000000;
                } else {
                    n.child[k] = made;
                    todo[waiting++] = { part[k], made++ };
                }
            }
        }
    }
};
