// OpenSubdiv's Catmull-Clark or Loop in double precision, with creases and sharp vertices.
//
// Standard input: the degree D of refined faces (4 or 3), counts V F C S and the levels; V points;
// F faces, each its degree and its vertices; C creases, each two vertices and their sharpness; S
// vertices, each with its sharpness. Standard output, for each corner of each refined face: its position, its limit and both
// limit tangents. Faces come as the children of corner 0, 1, ... of face 0, 1, ..., level by level,
// each from the old vertex on; in Loop's scheme the middle one last, from the first edge's vertex on.
#include <opensubdiv/far/primvarRefiner.h>
#include <opensubdiv/far/topologyDescriptor.h>

#include <cstdio>
#include <memory>
#include <vector>

#include "../../benchmarks/peers/driver.hpp"

using namespace OpenSubdiv;

// A face by its number, and the place of our first corner among the library's.
struct Face {
    int number, turn;
};

int main() {
    int degree, vertices, faces, creases, sharp, levels;
    if (std::scanf("%d %d %d %d %d %d", &degree, &vertices, &faces, &creases, &sharp, &levels) != 6)
        return 2;
    std::vector<Point> points(vertices);
    for (Point& p : points)
        if (std::scanf("%lf %lf %lf", &p.x[0], &p.x[1], &p.x[2]) != 3) return 2;
    std::vector<int> sizes(faces), corners, pairs(2 * creases);
    for (int& size : sizes) {
        if (std::scanf("%d", &size) != 1) return 2;
        for (int i = 0, v; i < size && std::scanf("%d", &v) == 1; ++i) corners.push_back(v);
    }
    std::vector<float> sharpness(creases);
    for (int i = 0; i < creases; ++i)
        if (std::scanf("%d %d %f", &pairs[2 * i], &pairs[2 * i + 1], &sharpness[i]) != 3) return 2;
    std::vector<int> tips(sharp);
    std::vector<float> of_tips(sharp);
    for (int i = 0; i < sharp; ++i)
        if (std::scanf("%d %f", &tips[i], &of_tips[i]) != 2) return 2;

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
    descriptor.numCorners = sharp;
    descriptor.cornerVertexIndices = tips.data();
    descriptor.cornerWeights = of_tips.data();
    Sdc::Options options;
    options.SetVtxBoundaryInterpolation(Sdc::Options::VTX_BOUNDARY_EDGE_ONLY);
    const std::unique_ptr<Far::TopologyRefiner> refiner(
        Factory::Create(descriptor, Factory::Options(degree == 3 ? Sdc::SCHEME_LOOP : Sdc::SCHEME_CATMARK, options)));
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
            const int count = degree == 3 ? 3 : children.size();
            for (int j = 0; j < count; ++j) {
                const int corner = (face.turn + j) % count;
                split.push_back({children[corner], count == degree ? corner : 0});
            }
            if (degree == 3) split.push_back({children[3], (face.turn + 2) % 3});
        }
        order.swap(split);
    }
    std::vector<Point> limits(points.size()), along(points.size()), across(points.size());
    primvar.Limit(points, limits, along, across);
    const Far::TopologyLevel last = refiner->GetLevel(levels);
    for (const Face& face : order) {
        const Far::ConstIndexArray corners = last.GetFaceVertices(face.number);
        for (int j = 0; j < degree; ++j) {
            const int v = corners[(face.turn + j) % degree];
            for (const Point* p : {&points[v], &limits[v], &along[v], &across[v]})
                std::printf("%.17g %.17g %.17g ", p->x[0], p->x[1], p->x[2]);
        }
        std::printf("\n");
    }
    return 0;
}
