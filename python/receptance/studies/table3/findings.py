as_dict=findings=None
