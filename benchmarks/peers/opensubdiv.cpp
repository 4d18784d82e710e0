// OpenSubdiv's uniform Loop of triangles, Catmull-Clark of quads: Far::TopologyRefiner and PrimvarRefiner.
#include <opensubdiv/far/primvarRefiner.h>
#include <opensubdiv/far/topologyDescriptor.h>

#include <memory>

#include "driver.hpp"

using namespace OpenSubdiv;

Arrays subdivide(const Arrays& in, int levels) {
    using Descriptor = Far::TopologyDescriptor;
    using Factory = Far::TopologyRefinerFactory<Descriptor>;
    const std::vector<int> sizes(in.face_count(), in.degree);
    Descriptor descriptor;
    descriptor.numVertices = int(in.vertex_count());
    descriptor.numFaces = int(in.face_count());
    descriptor.numVertsPerFace = sizes.data();
    descriptor.vertIndicesPerFace = in.faces.data();
    Sdc::Options options;
    options.SetVtxBoundaryInterpolation(Sdc::Options::VTX_BOUNDARY_EDGE_ONLY);
    const auto scheme = in.degree == 3 ? Sdc::SCHEME_LOOP : Sdc::SCHEME_CATMARK;
    const std::unique_ptr<Far::TopologyRefiner> refiner(
        Factory::Create(descriptor, Factory::Options(scheme, options)));
    Far::TopologyRefiner::UniformOptions uniform(levels);
    uniform.fullTopologyInLastLevel = false;
    refiner->RefineUniform(uniform);

    std::vector<Point> points(in.vertex_count());
    std::memcpy(points.data(), in.points.data(), in.points.size() * sizeof(double));
    Far::PrimvarRefiner primvar(*refiner);
    for (int level = 1; level <= levels; ++level) {
        std::vector<Point> next(refiner->GetLevel(level).GetNumVertices());
        primvar.Interpolate(level, points, next);
        points.swap(next);
    }
    const Far::TopologyLevel last = refiner->GetLevel(levels);
    Arrays out;
    out.degree = in.degree;
    out.points.resize(3 * points.size());
    std::memcpy(out.points.data(), points.data(), out.points.size() * sizeof(double));
    out.faces.reserve(in.degree * std::size_t(last.GetNumFaces()));
    for (int f = 0; f < last.GetNumFaces(); ++f) {
        const Far::ConstIndexArray corners = last.GetFaceVertices(f);
        for (int i = 0; i < in.degree; ++i) out.faces.push_back(corners[i]);
    }
    return out;
}

int main(int count, char** arguments) { return serve(count, arguments, subdivide, true); }
