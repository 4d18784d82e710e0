// OpenSubdiv's Catmull-Clark in double precision, with infinitely sharp creases.
//
// Standard input: counts V F C and the levels; V points; F faces, each its degree and its vertices;
// C creases, each two vertices. Standard output, for each corner of each refined quad: its position,
// its limit and both limit tangents. Quads come as the children of corner 0, 1, ... of face 0, 1, ...,
// level by level, each from the old vertex on.
#include <opensubdiv/far/primvarRefiner.h>
#include <opensubdiv/far/topologyDescriptor.h>

#include <cstdio>
#include <memory>
#include <vector>

using namespace OpenSubdiv;

struct Point {
    double x[3];
    void Clear(void* = nullptr) { x[0] = x[1] = x[2] = 0; }
    void AddWithWeight(const Point& from, double weight) {
        for (int k = 0; k < 3; ++k) x[k] += weight * from.x[k];
    }
};

// A face by its number, and the place of our first corner among the library's.
struct Face {
    int number, turn;
};

int main() {
    int vertices, faces, creases, levels;
    if (std::scanf("%d %d %d %d", &vertices, &faces, &creases, &levels) != 4) return 2;
    std::vector<Point> points(vertices);
    for (Point& p : points)
        if (std::scanf("%lf %lf %lf", &p.x[0], &p.x[1], &p.x[2]) != 3) return 2;
    std::vector<int> sizes(faces), corners, pairs(2 * creases);
    for (int& size : sizes) {
        if (std::scanf("%d", &size) != 1) return 2;
        for (int i = 0, v; i < size && std::scanf("%d", &v) == 1; ++i) corners.push_back(v);
    }
    for (int& v : pairs)
        if (std::scanf("%d", &v) != 1) return 2;
    const std::vector<float> sharpness(creases, Sdc::Crease::SHARPNESS_INFINITE);

    using Descriptor = Far::TopologyDescriptor;
    using Factory = Far::TopologyRefinerFactory<Descriptor>;
    Descriptor descriptor;
    descriptor.numVertices = vertices;
    descriptor.numFaces = faces;
    descriptor.numVertsPerFace = sizes.data();
    descriptor.vertIndicesPerFace = corners.data();
    descriptor.numCreases = creases;
    descriptor.creaseVertexIndexPairs = pairs.data();
    descriptor.creaseWeights = sharpness.data();
    Sdc::Options options;
    options.SetVtxBoundaryInterpolation(Sdc::Options::VTX_BOUNDARY_EDGE_ONLY);
    const std::unique_ptr<Far::TopologyRefiner> refiner(
        Factory::Create(descriptor, Factory::Options(Sdc::SCHEME_CATMARK, options)));
    Far::TopologyRefiner::UniformOptions uniform(levels);
    uniform.fullTopologyInLastLevel = true;
    refiner->RefineUniform(uniform);

    std::vector<Face> order(faces);
    for (int f = 0; f < faces; ++f) order[f] = {f, 0};
    Far::PrimvarRefinerReal<double> primvar(*refiner);
    for (int level = 1; level <= levels; ++level) {
        std::vector<Point> next(refiner->GetLevel(level).GetNumVertices());
        primvar.Interpolate(level, points, next);
        points.swap(next);
        const Far::TopologyLevel before = refiner->GetLevel(level - 1);
        std::vector<Face> split;
        for (const Face& face : order) {
            const Far::ConstIndexArray children = before.GetFaceChildFaces(face.number);
            const int count = children.size();
            for (int j = 0; j < count; ++j) {
                const int corner = (face.turn + j) % count;
                split.push_back({children[corner], count == 4 ? corner : 0});
            }
        }
        order.swap(split);
    }
    std::vector<Point> limits(points.size()), along(points.size()), across(points.size());
    primvar.Limit(points, limits, along, across);
    const Far::TopologyLevel last = refiner->GetLevel(levels);
    for (const Face& face : order) {
        const Far::ConstIndexArray quad = last.GetFaceVertices(face.number);
        for (int j = 0; j < 4; ++j) {
            const int v = quad[(face.turn + j) % 4];
            for (const Point* p : {&points[v], &limits[v], &along[v], &across[v]})
                std::printf("%.17g %.17g %.17g ", p->x[0], p->x[1], p->x[2]);
        }
        std::printf("\n");
    }
    return 0;
}
