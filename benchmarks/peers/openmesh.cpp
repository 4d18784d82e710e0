// OpenMesh's uniform Loop on a triangle mesh.
#include <OpenMesh/Core/Mesh/TriMesh_ArrayKernelT.hh>
#include <OpenMesh/Tools/Subdivider/Uniform/LoopT.hh>

#include "driver.hpp"

struct Traits : OpenMesh::DefaultTraits {
    using Point = OpenMesh::Vec3d;
};
using Mesh = OpenMesh::TriMesh_ArrayKernelT<Traits>;

Arrays subdivide(const Arrays& in, int levels) {
    Mesh mesh;
    mesh.reserve(in.vertex_count(), 3 * in.face_count() / 2, in.face_count());
    std::vector<Mesh::VertexHandle> vertices;
    vertices.reserve(in.vertex_count());
    for (std::size_t v = 0; v < in.vertex_count(); ++v)
        vertices.push_back(
            mesh.add_vertex({in.points[3 * v], in.points[3 * v + 1], in.points[3 * v + 2]}));
    for (std::size_t f = 0; f < in.face_count(); ++f)
        mesh.add_face(vertices[in.faces[3 * f]], vertices[in.faces[3 * f + 1]],
                      vertices[in.faces[3 * f + 2]]);
    OpenMesh::Subdivider::Uniform::LoopT<Mesh, double> loop;
    loop.attach(mesh);
    loop(levels);
    loop.detach();
    Arrays out;
    out.points.reserve(3 * mesh.n_vertices());
    out.faces.reserve(3 * mesh.n_faces());
    for (const auto v : mesh.vertices())
        for (int k = 0; k < 3; ++k) out.points.push_back(mesh.point(v)[k]);
    for (const auto f : mesh.faces())
        for (auto v = mesh.cfv_iter(f); v.is_valid(); ++v) out.faces.push_back(v->idx());
    return out;
}

int main(int count, char** arguments) { return serve(count, arguments, subdivide); }
