// A soft body in Unity: its mesh follows the deformation, its tool follows a transform. NOT VERIFIED IN UNITY: it compiles against
// stubs of UnityEngine (tests/csharp), no more.
//
// Put Palpate.cs and this file into Assets/, libpalpate.so into Assets/Plugins/x86_64/, and a scene of `palpate pack` into
// Assets/StreamingAssets/. Add the component to an empty object with a MeshFilter and a MeshRenderer at the origin, without rotation
// and scale: 1 Unity unit is 1 m.
using UnityEngine;
using Palpate;

[RequireComponent(typeof(MeshFilter))]
public sealed class PalpateBody : MonoBehaviour
{
    [Tooltip("Folder in StreamingAssets, of `palpate pack`")]
    public string scene = "liver.pack";

    [Tooltip("The tool is where this transform is")]
    public Transform tool;

    [Tooltip("Axes of the scene file")]
    public Axes axes = Axes.UnityFromZUp;

    [Tooltip("Body of the scene that is drawn")]
    public int body = 0;

    /// <summary>Force on the tool, N, in Unity's axes.</summary>
    public Vector3 Force { get; private set; }

    Scene loaded;
    ForceLoop loop;
    Mesh mesh;
    Vector[] nodes;
    Vector3[] vertices;
    Vector3 before;

    void OnEnable()
    {
        loaded = new Scene(System.IO.Path.Combine(Application.streamingAssetsPath, scene), axes);
        loop = new ForceLoop(loaded);
        nodes = loop.RestPositions(body);
        vertices = new Vector3[nodes.Length];
        mesh = new Mesh();
        mesh.indexFormat = UnityEngine.Rendering.IndexFormat.UInt32;
        mesh.MarkDynamic();
        CopyNodes();
        mesh.vertices = vertices;
        mesh.triangles = loop.Triangles(body);
        mesh.RecalculateNormals();
        GetComponent<MeshFilter>().mesh = mesh;
        if (tool != null) before = tool.position;
        loop.Start();
    }

    void Update()
    {
        if (loop == null) return;
        if (tool != null)
        {
            Vector3 at = tool.position;
            Quaternion turned = tool.rotation;
            Vector3 velocity = Time.deltaTime > 0 ? (at - before) / Time.deltaTime : Vector3.zero;
            before = at;
            loop.Move(0, new ToolInput
            {
                Position = new Vector(at.x, at.y, at.z),
                Orientation = new Rotation(turned.w, turned.x, turned.y, turned.z),
                Velocity = new Vector(velocity.x, velocity.y, velocity.z),
            });
        }
        loop.Refresh();
        if (loop.Fault != "") Debug.LogWarning(loop.Fault);
        Vector force = loop.Force(0);
        Force = new Vector3((float)force.X, (float)force.Y, (float)force.Z);
        loop.DeformedPositions(body, nodes);
        CopyNodes();
        mesh.vertices = vertices;
        mesh.RecalculateNormals();
        mesh.RecalculateBounds();
    }

    void OnDisable()
    {
        if (loop != null) loop.Dispose();
        if (loaded != null) loaded.Dispose();
        loop = null;
        loaded = null;
    }

    void CopyNodes()
    {
        for (int rank = 0; rank < nodes.Length; rank++)
            vertices[rank] = new Vector3((float)nodes[rank].X, (float)nodes[rank].Y, (float)nodes[rank].Z);
    }
}
