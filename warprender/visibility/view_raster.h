// Many views in one launch: each draws the instances of its own world.
//
// Pasted after raster.h, under the same rules.

typedef decltype(views) Views;  // Views of view_raster.py

// The part of the pictures that is one view's, as the task of that view alone.
struct ViewTask {
    RASTER_FN int world_of(const Views& views, int view)
    {
        int world = views.worlds.data[view];
        return world < 0 ? 0 : (world < views.lists.count ? world : views.lists.count - 1);
    }
    RASTER_FN void make(Task& task, const Views& views, int view)
    {
        int world = world_of(views, view), first = views.lists.starts.data[world];
        task.mesh.data += first;
        task.first_face.data += first;
        task.first_face.shape[0] = views.lists.starts.data[world + 1] - first;
        task.matrices.data += (long long)(views.stride) * view;
        long long pixels = (long long)(task.width) * task.height * view;
        auto skip = [](auto& array, long long count) {
            if (array.data)
                array.data += count;
        };
        skip(task.face, pixels);
        skip(task.u, pixels);
        skip(task.v, pixels);
        skip(task.depth, pixels);
        skip(task.keys, pixels);
        skip(task.entries, 3ll * views.most_faces * view);
        skip(task.taken, view);
    }
    RASTER_FN int faces(const Task& task, int draw)
    {
        return task.meshes.data[task.mesh.data[draw]].indices.shape[0] / 3;
    }
    // Faces of all draws.
    RASTER_FN int faces(const Task& task)
    {
        int last = task.first_face.shape[0] - 1;
        return last < 0 ? 0 : task.first_face.data[last] + faces(task, last);
    }
};

#ifndef __CUDACC__
// A tile of a view, drawn without sorting triangles into bins: that is for few of them.
struct ViewTile {
    enum { Shift = 6 };

    RASTER_FN void group(Tile& tile, int face, int count)
    {
        int present = count < 8 ? (1 << count) - 1 : 255;
        for (int lane = 0; lane < 8; ++lane)
            tile.faces[lane] = present >> lane & 1 ? face + lane : 0;
        Corners corners = {};
        present &= ~Corners::load(corners, tile.mesh, tile.faces, present);
        Batch b;
        Batch::make(b, corners, present);
        if (!b.alive)
            return;
        Batch::project(b, (double)(tile.bins.width), (double)(tile.bins.height));
        Batch::set_up(b, tile.cull);
        Tile::draw_small(tile, b);
        for (int others = b.alive & ~b.small; others; others &= others - 1)
            Tile::draw(tile, tile.mesh.first + face + __builtin_ctz(others));
    }
    RASTER_FN void run(Task task, const Views& views, int item)
    {
        int view = item / views.tiles;
        ViewTask::make(task, views, view);
        task.shift = Shift;
        alignas(64) unsigned long long keys[1 << 2 * Shift];
        Bins bins;
        Bins::make(bins, task);
        Tile tile;
        Tile::make(tile, bins, item % views.tiles, task.cull, keys);
        const int* box = (const int*)(views.boxes.data + (long long)(views.stride) * view);
        for (int draw = 0; draw < task.first_face.shape[0]; ++draw, box += 4) {
            if (box[0] > tile.x1 || box[1] > tile.y1 || box[2] <= tile.x0 || box[3] <= tile.y0)
                continue;
            Mesh::make(tile.mesh, task, draw);
            int count = ViewTask::faces(task, draw);
            for (int face = 0; face < count; face += 8)
                group(tile, face, count - face);
        }
        Tile::finish(tile, task);
    }
};
#endif
